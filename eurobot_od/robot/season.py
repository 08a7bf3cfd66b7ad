"""Questions to a season of the robot's logs: gotos, arrivals, stops, and of simulated matches points and touches.

A log has the nodes' messages, not the true places. So the error of an arrival is the distance from the goto's place to
the drive's estimate, and to the beacons' measurement. Points and touches are in no message: `match --log` writes them
beside the log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import attrgetter
from pathlib import Path

from eurobot_od.robot.model.messages import CATALOGUE
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.scene.recording import read_truth
from eurobot_od.season.events import LogEvent
from eurobot_od.season.reports import Chart, ChartKind, SeasonReport, spread


def events_of(log: Path) -> Sequence[LogEvent]:
    """Return the truth beside a log as events, first where the match began; raises LocalError for a damaged file."""
    truth = read_truth(log)
    begun = [LogEvent(each.time, "start", OURS, f"{each.x:.0f}, {each.y:.0f} mm") for each in truth.path[:1]]
    touches = [LogEvent(each.time, "touch", OURS if each.at_fault else "other", each.words) for each in truth.touches]
    scores = [LogEvent(each.time, "points", each.robot, each.task, each.points) for each in truth.scores]
    said = [LogEvent(each.time, "said", each.robot, each.words) for each in truth.captions]
    return sorted(begun + touches + scores + said, key=attrgetter("t"))


LATENCIES = """
SELECT min(c.t - g.t) AS latency
FROM goto_confirm c ASOF JOIN goto_xy g ON c.run = g.run AND c.channel = g.channel AND c.line >= g.line
GROUP BY g.run, g.line"""

LATENCY = f"SELECT count(*) AS confirmed, {spread('latency')} FROM ({LATENCIES})"

ARRIVALS = """
WITH ends AS (
    SELECT g.run, g.channel, g.line AS goto_line, g.t AS asked, g.x, g.y, min(s.line) AS line, min(s.t) AS t
    FROM goto_state_response s ASOF JOIN goto_xy g ON s.run = g.run AND s.channel = g.channel AND s.line >= g.line
    WHERE s.time = 0 GROUP BY ALL
),
believed AS (
    SELECT e.*, sqrt((k.x - e.x) ** 2 + (k.y - e.y) ** 2) AS error
    FROM ends e ASOF JOIN kalman_position_response k
        ON e.run = k.run AND e.channel = k.channel AND e.line <= k.line
),
arrivals AS (
    SELECT b.*, sqrt((n.x - b.x) ** 2 + (n.y - b.y) ** 2) AS beacons
    FROM believed b ASOF LEFT JOIN navi_position_response n
        ON b.run = n.run AND b.channel = n.channel AND b.line <= n.line
)"""

ERRORS = f"""{ARRIVALS}
SELECT log, count(*) AS arrivals, round(avg(t - asked), 2) AS mean_s, round(avg(error), 1) AS mean_mm,
    round(quantile_cont(error, 0.95), 1) AS p95_mm, round(max(error), 1) AS most_mm,
    round(avg(beacons), 1) AS beacons_mm
FROM arrivals a JOIN runs r ON a.run = r.run GROUP BY log ORDER BY most_mm DESC, log"""

CODES = " ".join(f"WHEN {code} THEN '{words}'" for code, words in CATALOGUE.errors.items())

# As the picture of the field counts them (`scene.recording`): once until the next goto, an EMCY each time.
STOPS = f"""
WITH codes AS (
    SELECT f.run, f.channel, f.line, CAST('0x' || hex(f.data)[3:4] || hex(f.data)[1:2] AS INTEGER) AS code
    FROM frames f JOIN runs r ON f.run = r.run
    WHERE cob_id BETWEEN 129 AND 255 AND octet_length(data) = 8
        AND cob_id NOT IN (SELECT m.cob_id FROM messages m WHERE m.eds = r.eds)
),
sent AS (
    SELECT run, channel, line, 'Emergency Stop: ' || obstacle AS reason, 'stop' AS what FROM emergency_stop
    UNION ALL SELECT run, channel, line, 'Stop Drive', 'stop' FROM stop_drive
    UNION ALL SELECT run, channel, line, 'Emergency Shutdown', 'shutdown' FROM emergency_shutdown
    UNION ALL SELECT run, channel, line, 'goto ' || time_flag, 'end' FROM goto_state_response
        WHERE time_flag IN ('blocked', 'not possible')
    UNION ALL
    SELECT run, channel, line, 'EMCY ' || CASE code {CODES} ELSE printf('0x%04X', code) END, 'EMCY ' || line
    FROM codes WHERE code <> 0
),
told AS (
    SELECT s.*, row_number() OVER (PARTITION BY s.run, s.channel, g.line, what ORDER BY s.line) = 1 AS is_new
    FROM sent s ASOF LEFT JOIN goto_xy g ON s.run = g.run AND s.channel = g.channel AND s.line >= g.line
)
SELECT reason, count(*) FILTER (is_new) AS stops, count(*) AS frames,
    count(DISTINCT t.run) AS logs, arg_min(log, log) AS first_log, arg_min(line, (log, line)) AS first_line
FROM told t JOIN runs r ON t.run = r.run GROUP BY reason ORDER BY stops DESC, reason"""

OURS_ONLY = f"kind = 'points' AND robot = '{OURS}'"

POINTS = f"""
SELECT log, coalesce(sum(points) FILTER ({OURS_ONLY}), 0)::BIGINT AS points, count(*) FILTER ({OURS_ONLY}) AS tasks,
    coalesce(sum(points) FILTER (kind = 'points' AND robot <> '{OURS}'), 0)::BIGINT AS others,
    round(max(t - start) FILTER ({OURS_ONLY}), 1) AS last_s
FROM events e JOIN runs r ON e.run = r.run GROUP BY r.run, log ORDER BY points DESC, log"""

TOUCHES = f"""
SELECT log, count(*) FILTER (kind = 'touch') AS touches,
    count(*) FILTER (kind = 'touch' AND robot = '{OURS}') AS our_fault,
    round(min(t - start) FILTER (kind = 'touch'), 1) AS first_s, arg_min(text, t) FILTER (kind = 'touch') AS first
FROM events e JOIN runs r ON e.run = r.run GROUP BY r.run, log ORDER BY our_fault DESC, touches DESC, log"""

REPORTS: Mapping[str, SeasonReport] = {
    "latency": SeasonReport(
        "From a goto to its confirm",
        LATENCY,
        Chart(ChartKind.HISTOGRAM, "from goto to confirm, ms", "gotos", f"SELECT latency * 1000 FROM ({LATENCIES})"),
    ),
    "arrivals": SeasonReport(
        "Position error at arrival: the place that the drive believes in, and that the beacons give",
        ERRORS,
        Chart(ChartKind.HISTOGRAM, "position error, mm", "arrivals", f"{ARRIVALS} SELECT error FROM arrivals"),
    ),
    "stops": SeasonReport(
        "Stops and their reasons", STOPS, Chart(ChartKind.BARS, "", "stops", f"SELECT reason, stops FROM ({STOPS})")
    ),
    "points": SeasonReport(
        "Points of each simulated match",
        POINTS,
        Chart(ChartKind.HISTOGRAM, "points", "matches", f"SELECT points FROM ({POINTS})"),
    ),
    "touches": SeasonReport(
        "Touches of each simulated match",
        TOUCHES,
        Chart(ChartKind.HISTOGRAM, "touches", "matches", f"SELECT touches FROM ({TOUCHES})"),
    ),
}
"""Reports by name, in addition to those for any devices."""
