#!/usr/bin/python3
"""Narrow edges, points on facets, edges that cross: against contact in one point."""
import assembly_case

assembly_case.main("points")
