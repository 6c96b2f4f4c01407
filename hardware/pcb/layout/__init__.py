"""Where everything stands, in millimetres: footprints, placement, rules, routes."""
