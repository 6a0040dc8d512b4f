"""Figures for papers: long rows of numbers, and how each view draws them."""
