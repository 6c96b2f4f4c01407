"""Names that ship, for a shell that completes them; those of robots, worlds and bodies are in `p2os.cli.names`."""

from robot_bench.scenario.scenario import known_scenarios


def scenario_names(incomplete: str) -> list[str]:
    """Return the scenarios that ship."""
    return [name for name in known_scenarios() if name.startswith(incomplete)]
