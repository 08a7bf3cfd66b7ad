"""Service data objects (CiA 301, 7.2.4): command bytes, server and client, all without a bus."""
