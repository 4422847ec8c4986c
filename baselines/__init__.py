"""Classical guidance and control policies, and the report about them."""
