"""The Eurobot 2014 robot: its messages, nodes, world, matches and checks. Nothing below imports this package."""
