"""A network's messages and devices in the forms of other tools and languages: DBC, C, Lua, XDD, Markdown, HTML.

Rule of this package: names and texts of a file are never written unchanged. `description` makes identifiers of other
languages from names, and every text is escaped for its place.
"""
