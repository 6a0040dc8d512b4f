"""Strategies that deal one budget over many first candidates and all that is made from them."""
