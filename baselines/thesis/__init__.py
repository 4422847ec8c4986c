"""Reproduction of the source thesis: Ma Jian, Formation Flying of Spacecrafts for Monitoring and Inspection, 2009."""
