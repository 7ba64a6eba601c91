"""The account of fields, audited against the numbers in the pictures, while everything goes wrong."""
