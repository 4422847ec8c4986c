"""Satellite formation flying as Gymnasium environments."""
