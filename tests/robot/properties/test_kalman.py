"""Laws of the Kalman filter: whatever comes, its covariance stays one, and a measurement makes it surer."""

from __future__ import annotations

import itertools
import math

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.nodes.estimate import Belief, Covariance, Estimate, Travel, Tuning
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.navigation import Fix

FACTS = robot_file.read()

zero_or = st.sampled_from([0.0, 0.1, 1.0, 30.0, 1000.0])
tunings = st.builds(
    Tuning,
    navigation=zero_or,
    navigation_angle=zero_or,
    latency=st.sampled_from([0.0, 0.1, 2.0]),
    gate=st.sampled_from([0.0, 0.9, 0.999, 1.0]),
    placement=zero_or,
    placement_angle=zero_or,
    scale=st.sampled_from([0.0, 0.01, 0.2]),
    distance=zero_or,
    drift=zero_or,
    turning=zero_or,
)
movements = st.builds(Odometry, st.floats(-100.0, 100.0), st.floats(-90.0, 90.0))
angles = st.floats(0.0, 360.0)
poses = st.builds(Pose, st.floats(0.0, FACTS.field.width), st.floats(0.0, FACTS.field.height), angles)
fixes = st.builds(Fix, st.floats(0.0, FACTS.field.width), st.floats(0.0, FACTS.field.height), st.none() | angles)
steps = st.lists(st.one_of(movements, fixes), max_size=40)
travels = st.builds(Travel, st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.floats(-180.0, 180.0))


def after(step: Odometry | Fix, belief: Belief, travel: Travel, tuning: Tuning) -> Belief:
    if isinstance(step, Odometry):
        return belief.moved(step, tuning)
    return belief.corrected(belief.compared(step, travel, tuning))[0]


def is_covariance(covariance: Covariance) -> bool:
    """Return whether it is symmetric and, to what is rounded, positive: no part is known better than not at all."""
    symmetric = all(covariance[i][j] == covariance[j][i] for i, j in itertools.product(range(4), repeat=2))
    sizes = [math.sqrt(max(covariance[i][i], 0.0)) for i in range(4)]
    pairs = (abs(covariance[i][j]) <= sizes[i] * sizes[j] * (1 + 1e-9) + 1e-9 for i in range(4) for j in range(i))
    return symmetric and all(covariance[i][i] >= 0.0 for i in range(4)) and all(pairs)


@given(poses, tunings, travels, steps)
def test_a_covariance_stays_symmetric_and_positive(
    pose: Pose, tuning: Tuning, travel: Travel, steps: list[Odometry | Fix]
) -> None:
    belief = Belief.at(pose, tuning.placement_variances, tuning.scale)
    for step in steps:
        belief = after(step, belief, travel, tuning)
        assert is_covariance(belief.covariance)


@given(poses, tunings, steps, fixes)
def test_a_measurement_makes_surer_and_goes_part_of_the_way(
    pose: Pose, tuning: Tuning, steps: list[Odometry | Fix], fix: Fix
) -> None:
    still = Travel(0.0, 0.0, 0.0)
    belief = Belief.at(pose, tuning.placement_variances, tuning.scale)
    for step in steps:
        belief = after(step, belief, still, tuning)
    corrected, distance = belief.corrected(belief.compared(fix, still, tuning))
    assert distance >= 0.0
    assert all(new <= old + 1e-9 for old, new in zip(belief.deviations, corrected.deviations))


@given(tunings, st.none() | poses, steps)
def test_an_estimate_is_a_pose_or_nothing(tuning: Tuning, pose: Pose | None, steps: list[Odometry | Fix]) -> None:
    estimate = Estimate(tuning, pose)
    for number, step in enumerate(steps):
        if isinstance(step, Odometry):
            estimate.moved(step, number / 100)
        else:
            estimate.corrected(step, number / 100)
        assert (estimate.pose is None) is (estimate.deviations is None)
        if estimate.pose is not None:
            assert 0.0 <= estimate.pose.angle < 360.0
            assert all(map(math.isfinite, estimate.pose))
