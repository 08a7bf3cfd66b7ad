"""A network's messages and devices in the forms of other tools and languages: DBC, C, Lua, XDD, Markdown, HTML.

Rule of this package: no name and no text of a file is written unchanged. Identifiers of other languages are made by
`names`, and every text is escaped for its place.
"""
