"""Machines that one can make: files of CAD programs and printers, parts lists, instructions.

The modules that write files of CAD programs and printers need the extra `cad`; nothing else imports
them when it starts.
"""
