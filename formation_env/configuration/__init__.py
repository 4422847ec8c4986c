"""Reading of configuration files, and the texts of their errors; `formation_env.settings` validates what they hold."""
