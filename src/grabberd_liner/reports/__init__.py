"""The text and figures of the liner's reports: of analyses, studies and guided tests.

Their templates stand on those of the program's reports: page, style and macros are the same.
"""
