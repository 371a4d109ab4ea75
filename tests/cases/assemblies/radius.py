#!/usr/bin/python3
"""Sheets that move farther than they are thick, turned by any angle."""
import assembly_case

assembly_case.main("radius")
