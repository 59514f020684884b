"""The scenarios that come with mmslam, and scenarios from files."""

from mmslam.table import Table, html, text
from scenes.files.loading import load_scenario, scenario_titles
from scenes.scenario import Scenario

__all__ = ["Scenario", "load_scenario", "scenarios"]


class Titles(dict[str, str]):
    """One-line title of each scenario by its name; prints as a table."""

    def table(self) -> Table:
        """Return names and titles."""
        return Table(heads=("scenario", "shows"), rows=[*self.items()])

    def __repr__(self) -> str:
        """Show a line for each."""
        return text([self.table()])

    def _repr_html_(self) -> str:
        return html([self.table()])


def scenarios() -> Titles:
    """List the scenarios that come with mmslam.

    Examples
    --------
    >>> "slam_2d" in scenarios()
    True
    >>> scenarios()["los_user"]
    'A user in plain sight beside a mirror'
    """
    return Titles(scenario_titles())
