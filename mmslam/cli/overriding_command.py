"""A command that takes overrides, and says how where one is given without ``--set``."""

from typing import Any

from typer.core import TyperCommand


class OverridingCommand(TyperCommand):
    """A command with the option ``--set KEY=VALUE``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as usual; of an argument too many that looks like an override, name ``--set``."""
        ctx.allow_extra_args = True
        rest = super().parse_args(ctx, args)
        if rest and not ctx.resilient_parsing:
            told = f"Got unexpected extra argument{'s'[: len(rest) - 1]} ({' '.join(rest)})"
            overrides = [one for one in rest if "=" in one]
            if overrides:
                told += f"; to override a key, write --set {' --set '.join(overrides)}"
            ctx.fail(told)
        return rest
