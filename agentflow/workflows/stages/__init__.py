"""Stages shared by workflows."""
