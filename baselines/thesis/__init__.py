"""The source thesis, reproduced: Ma Jian, Formation Flying of Spacecrafts for Monitoring and Inspection, 2009."""
