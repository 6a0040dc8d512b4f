"""Benches over the Model Context Protocol (MCP), with the SDK `mcp`."""
