"""The parser of every command: its options in groups, the same everywhere, and examples below them."""

from __future__ import annotations

import argparse
import textwrap
from typing import Any

from shapegcode.cli.examples import EXAMPLES

GROUPS: dict[str, tuple[str, ...]] = {
    "input": (
        "input", "inputs", "files", "dump", "name", "kind", "machine", "set", "program", "against", "shaped", "lines",
        "answers", "base", "programs", "compensation", "cut", "mode", "uncertainty", "axes", "axis", "units", "box",
        "override", "rapid_override", "part_mass", "shell",
    ),
    "what to do": ("write", "fit", "servo", "runs", "tap_plan", "list_families"),
    "what to shape": (
        "shaper", "contour", "per_axis", "shape_rapids", "arc_feed", "shape_all", "only", "leave", "block_period",
    ),
    "tolerance": (
        "at_least", "contour_tolerance", "vibration_limit", "max_duration", "max_abs_sum", "margin", "settling_band",
    ),
    "differences": ("allow",),
    "price": ("max_time_increase", "max_cut_time_increase", "tolerance_curve"),
    "budget": ("max_bytes", "baud", "max_blocks_per_second"),
    "cut": (
        "feed_schedule", "tool", "stock", "resolution", "tool_diameter", "spindle", "axial_depth", "feed", "feeds",
        "radial_depth", "length", "allowance", "rough_radius", "finish_radius", "interval", "intervals", "up",
        "forces_on", "chip_thickness", "edge_forces",
    ),
    "calculation": (
        "plant", "no_full", "look_ahead", "drive", "continuous", "family", "objective", "negative", "taps", "speed",
        "radius", "modes", "most_modes", "frequencies", "ignore_force", "start", "station", "cutoff", "lambda_s",
    ),
    "modes that were not measured on this machine": ("keep_modes", "rigid"),
    "what a file does not say": (
        "time_column", "force_column", "response_columns", "time_unit", "force_unit", "response_unit", "period_s",
        "quantity", "force_scale", "response_scale", "force_sensitivity", "response_sensitivity", "response_first",
    ),
    "runs": (
        "draws", "batch_command", "resume", "jobs", "time_limit", "memory_limit", "scheduler", "tls_ca", "tls_cert",
        "tls_key",
    ),
    "output": (
        "output", "update", "write_origins", "force", "full", "csv", "npz", "every", "blocks", "plots", "json", "html",
        "html_script",
    ),
    "how much is said": ("quiet", "verbose", "cite"),
}  # fmt: skip
"""Group of an option by its destination, one table for all commands: what is the same stands at the same place."""

_GROUP_OF = {dest: title for title, dests in GROUPS.items() for dest in dests}
_EXIT_CODES = "0 done and within tolerance; 1 done, but out of tolerance; 2 not done: bad input"


class _Formatter(argparse.HelpFormatter):
    """Wraps the description, and leaves lines of the epilog as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if "\n" not in text:
            return super()._fill_text(text, width, indent)
        lines = []
        for line in text.split("\n"):
            # A command has to stay whole, so that it can be copied.
            whole = line.startswith("  ")
            lines += [line] if whole else textwrap.wrap(line, width, break_long_words=False) or [""]
        return "\n".join(indent + line for line in lines)


class CommandParser(argparse.ArgumentParser):
    """A parser that puts each option into its group."""

    def __init__(self, **kwargs: Any) -> None:
        """Make it."""
        self._titled: dict[str, argparse._ArgumentGroup] = {}
        super().__init__(**({"formatter_class": _Formatter} | kwargs))

    def group(self, title: str) -> argparse._ArgumentGroup:
        """The group of that title."""
        if title not in self._titled:
            self._titled[title] = self.add_argument_group(title)
        return self._titled[title]

    def add_argument(self, *names: str, **kwargs: Any) -> argparse.Action:
        """Declare an argument, in its group."""
        title = _GROUP_OF.get(kwargs.get("dest") or _dest(names))
        if title is None:
            return super().add_argument(*names, **kwargs)
        return self.group(title).add_argument(*names, **kwargs)

    def format_help(self) -> str:
        """The help text, its groups in the order of `GROUPS`, with examples and exit codes below."""
        ranks = {title: rank for rank, title in enumerate(GROUPS, start=1)}
        # First what argparse makes itself: options, actions.
        self._action_groups.sort(key=lambda group: ranks.get(group.title or "", 0))
        kept = self.epilog
        try:
            self.epilog = self.epilogue()
            return super().format_help()
        finally:
            self.epilog = kept

    def epilogue(self) -> str | None:
        """What stands below the options: examples, and the exit codes."""
        words = self.prog.split(maxsplit=1)
        lines = EXAMPLES.get(words[1] if len(words) > 1 else "", ())
        if not lines:
            return self.epilog
        # What a command's exit codes mean stands in its description, where it is not the usual.
        said = (self.description or "").lower()
        codes = "" if "exit code 0" in said else f"\n\nexit codes: {_EXIT_CODES}."
        return "\n".join(["examples:", *(f"  {line}" for line in lines)]) + codes + (self.epilog or "")


def one_of(parser: argparse.ArgumentParser, title: str, *, required: bool = False) -> argparse._MutuallyExclusiveGroup:
    """Options of which one alone can be given, in their group."""
    group = parser.group(title) if isinstance(parser, CommandParser) else parser.add_argument_group(title)
    return group.add_mutually_exclusive_group(required=required)


def add_alias(parser: argparse.ArgumentParser, old: str, option: str) -> None:
    """Let an option be typed by the name that it had before; no help shows that."""
    found = next(action for action in parser._actions if option in action.option_strings)
    parser._option_string_actions[old] = found


def _dest(names: tuple[str, ...]) -> str:
    """The destination that argparse takes of the names."""
    long = next((name for name in names if name.startswith("--")), names[0] if names else "")
    return long.lstrip("-").replace("-", "_")
