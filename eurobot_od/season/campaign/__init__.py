"""Much work in blocks, on any `concurrent.futures.Executor`: processes of this machine, or workers on several.

An item is what one call does, such as the match of a seed. Items go out in blocks (`blocks`), results come back in the
items' order, and may be kept in Parquet files, a file for each block, from which a campaign is taken up again
(`results`). Where the work is done is the executor's business (`executors`); there is no scheduler here.

Rule of this package: an item's result depends on the item alone. So a block whose worker was lost is done again, and
the results are the same on any executor.
"""

MOST_JOBS = 60
"""More processes than these cannot be waited for on Windows."""
