#!/usr/bin/python3
"""Redundant rows: a fine surface over the joint of two coarse ones, theta = 0."""
import assembly_case

assembly_case.main("joints")
