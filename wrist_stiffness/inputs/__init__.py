"""Files that people write: opened, read and checked so that any error names place, value and limit.

`document` reads YAML and JSON into nodes that know their line; `schema` says what must be there.
"""
