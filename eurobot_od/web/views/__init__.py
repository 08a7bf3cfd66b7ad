"""The requests of each view of the page: a function for each, which calls what the commands call."""
