"""A network's messages and devices in the forms of other tools and languages: DBC, C, Lua, XDD, Markdown, HTML.

Rule of this package: no name and no text of a file goes out as it is. What another language takes for an identifier is
made by `names`, and every text is escaped for where it stands.
"""
