#!/usr/bin/python3
"""Redundant rows: a fine surface over the joint of two coarse ones, theta = 0. Their pressures are known to rounding over the
proximal term of the linear systems, 1e-3."""
import assembly_case

assembly_case.main("joints", same=1e-2)
