"""Devices by what they are: folders of EDS, DCF, XDD and XDC files, found by identity (0x1018) and type (0x1000).

`files` says where they are and what each one describes, `library` which one fits a device.
"""
