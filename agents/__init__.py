"""Reinforcement learning: training, shipped policies and their report."""
