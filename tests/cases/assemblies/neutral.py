#!/usr/bin/python3
"""Motions that nothing but the facets of the mesh resists."""
import assembly_case

assembly_case.main("neutral")
