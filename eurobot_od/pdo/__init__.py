"""What the bits of a PDO mean: layouts, kinds of fields, messages, and the table of them that a network has."""
