"""What CiA 401 and 402 fix about objects and values, as tables; and values in words."""
