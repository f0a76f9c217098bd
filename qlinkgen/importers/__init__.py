"""Imports descriptions of protocols from files of other formats: each module reads one into a `Document`.

`written` turns a document into the text of a schema file that `qlinkgen lint` accepts.
"""
