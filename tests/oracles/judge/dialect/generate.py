"""Random programs in the dialect, valid by construction except for what arithmetic does (it needs hypothesis and is not
imported by the package)."""

from __future__ import annotations

import math

from hypothesis import strategies as st

Draw = st.DrawFn


@st.composite
def expressions(draw: Draw, depth: int = 3) -> str:
    """An expression over #1 ... #9; values stay small, but divisions by zero and roots of negatives can occur."""
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        return draw(
            st.one_of(
                st.integers(1, 9).map(lambda n: f"#{n}"),
                st.integers(-40, 40).map(lambda n: f"{n / 4:g}" if n >= 0 else f"[{n / 4:g}]"),
                st.integers(0, 12).map(lambda n: f"{n}."),
            )
        )
    below = expressions(depth - 1)
    kind = draw(st.integers(0, 5))
    if kind <= 2:
        left, right = draw(below), draw(below)
        return f"{left}{draw(st.sampled_from(['+', '-', '*', '/', ' MOD ']))}{right}"
    if kind == 3:
        return f"[{draw(below)}]"
    if kind == 4:
        return f"{draw(st.sampled_from(['SIN', 'COS', 'ABS', 'FIX', 'FUP', 'ROUND', 'SQRT']))}[{draw(below)}]"
    return f"ATAN[{draw(below)}]/[{draw(below)}]"


@st.composite
def macro_programs(draw: Draw) -> str:
    """Assignments, loops, branches, calls with arguments and repeats, and lines to computed places."""
    body: list[str] = []
    for n in range(1, draw(st.integers(2, 7))):
        body.append(f"#{n}={draw(expressions())}")
    for k in range(draw(st.integers(1, 6))):
        kind = draw(st.integers(0, 5))
        place = f"X[[{draw(expressions(2))}] MOD 50]Y[#{draw(st.integers(1, 9))} MOD 40]"
        if kind <= 1:
            body.append(f"G01{place}F{draw(st.integers(100, 900))}.")
        elif kind == 2:
            body += [
                f"#{10 + k}={draw(st.integers(0, 3))}",
                f"WHILE[#{10 + k}LT{draw(st.integers(0, 5))}]DO{draw(st.integers(1, 3))}",
                f"G01{place}",
                f"#{10 + k}=#{10 + k}+1",
            ]
            body.append("END" + body[-3].rpartition("DO")[2])
        elif kind == 3:
            comparison = draw(st.sampled_from(["EQ", "NE", "GT", "GE", "LT", "LE"]))
            body += [
                f"IF[{draw(expressions(1))}{comparison}{draw(expressions(1))}]GOTO{100 + k}",
                f"G01{place}",
                f"N{100 + k}",
            ]
        elif kind == 4:
            letters = draw(st.lists(st.sampled_from("ABCDEFHIJKMQRSTUVWXYZ"), max_size=6))
            words = "".join(f"{letter}{draw(st.integers(-99, 99)) / 10}" for letter in letters)
            body.append(f"G65P20L{draw(st.integers(1, 3))}{words}")
        else:
            body.append(f"M98P30L{draw(st.integers(1, 3))}")
    macro = "O20\n#100=#100+1\nG01X[#1+#4+#7+#24]Y[#2+#5+#8+#25+#100]Z[#3+#6+#26]F300.\nX#11\nM99"
    sub = "O30\nG91G01X[#1 MOD 7.]Y1.F200.\nG90\n#2=#2+0.5\nM99"
    return "\n".join(["%", "O1", "G21G17G90G94", "G00X0Y0Z0", "G01F500.", *body, "G00Z50.", "M30", macro, sub, "%", ""])


def _number(value: float) -> str:
    return f"{value:.3f}".rstrip("0")


@st.composite
def coordinate_programs(draw: Draw) -> str:
    """A contour with lines and arcs under shifts, rotation, scaling and mirror image, and drilling between."""
    lines = ["%", "O1", "G21G17G90G94", "G00X0Y0Z10."]
    whole = st.integers(-30, 30)
    for _ in range(draw(st.integers(1, 5))):
        modes: list[tuple[str, str]] = []
        if draw(st.booleans()):
            modes.append((f"G52X{draw(whole)}.Y{draw(whole)}.", "G52X0Y0"))
        choice = draw(st.integers(0, 4))
        if choice == 0:
            factor = draw(st.integers(2, 30)) * 100
            modes.append((f"G51X{draw(whole)}.Y{draw(whole)}.Z0I{factor}J{factor}K1000", "G50"))
        elif choice == 1:
            axes = draw(st.sampled_from(["X{}.", "Y{}.", "X{}.Y{}."]))
            modes.append(("G51.1" + axes.format(draw(whole), draw(whole)), "G50.1X0Y0"))
        elif choice == 2:
            modes.append((f"G51X0Y0Z0P{draw(st.integers(2, 30)) * 100}", "G50"))
        if choice in (1, 2, 3) and draw(st.booleans()):
            modes.append((f"G68X{draw(whole)}.Y{draw(whole)}.R{draw(st.integers(-1800, 1800)) / 10}", "G69"))
        lines += [on for on, _ in modes]
        x, y = draw(whole), draw(whole)
        lines += [f"G90G00X{x}.Y{y}.", "G01Z-2.F100."]
        for _ in range(draw(st.integers(1, 5))):
            lines.append(draw(_contour_step()))
        lines += ["G90G00Z10."]
        # Whether levels of a cycle are scaled is not for a test to say.
        if choice != 2 and draw(st.booleans()):
            code = draw(st.sampled_from(["G81", "G82", "G83", "G73", "G85", "G89"]))
            q = f"Q{draw(st.integers(2, 6))}." if code in ("G83", "G73") else ""
            p = f"P{draw(st.integers(1, 9)) * 100}" if code in ("G82", "G89") else ""
            lines.append(
                f"{draw(st.sampled_from(['G98', 'G99']))}{code}X{draw(whole)}.Y{draw(whole)}.Z-9.R2.{q}{p}F150."
            )
            if draw(st.booleans()):
                lines += [f"G91X{draw(st.integers(1, 9))}.Y{draw(whole)}.K{draw(st.integers(0, 4))}", "G90"]
            lines += ["G80", "G00Z10."]
        lines += [off for _, off in reversed(modes)]
        lines.append("G90G00X0Y0Z10.")
    return "\n".join([*lines, "M30", "%", ""])


@st.composite
def _contour_step(draw: Draw) -> str:
    """A line or an arc of 10° to 350° in G91, exact to the least increment where it starts; arcs by I J or by R."""
    if draw(st.booleans()):
        return f"G91G01X{draw(st.integers(-20, 20))}.Y{draw(st.integers(1, 20))}.F{draw(st.integers(100, 900))}."
    radius = float(draw(st.integers(5, 30)))
    start = math.radians(draw(st.integers(0, 359)))
    turn = math.radians(draw(st.integers(10, 350))) * (1 if (ccw := draw(st.booleans())) else -1)
    i, j = round(-radius * math.cos(start), 3), round(-radius * math.sin(start), 3)
    true_radius, angle = math.hypot(i, j), math.atan2(-j, -i) + turn
    x, y = i + true_radius * math.cos(angle), j + true_radius * math.sin(angle)
    code = "G03" if ccw else "G02"
    if draw(st.booleans()) and 0.35 < abs(turn) < 2.6:
        return f"G91{code}X{_number(x)}Y{_number(y)}R{_number(true_radius)}F300."
    return f"G91{code}X{_number(x)}Y{_number(y)}I{_number(i)}J{_number(j)}F300."


@st.composite
def compensated_programs(draw: Draw) -> str:
    """A contour under G41 or G42 whose elements are long enough for any corner up to 120 degrees, inner or outer."""
    radius = draw(st.integers(4, 40)) / 4.0
    side = draw(st.sampled_from(["G41", "G42"]))
    heading = math.radians(draw(st.integers(0, 359)))
    lines = ["%", "O1", "G21G17G90G94", f"G10L12P1R{_number(radius)}", "G00X0Y0Z5.", "G01Z-1.F100.", "G91"]
    first = 3.0 * radius
    lines.append(f"{side}D1X{_number(first * math.cos(heading))}Y{_number(first * math.sin(heading))}F300.")
    heading += math.radians(draw(st.integers(-60, 60)))
    for _ in range(draw(st.integers(2, 7))):
        # Two arcs need not meet inside of their corner: a line stands between them.
        if "I" in lines[-1] or draw(st.integers(0, 2)):
            length = radius * draw(st.integers(40, 90)) / 10.0
            lines.append(f"G01X{_number(length * math.cos(heading))}Y{_number(length * math.sin(heading))}")
        else:
            size, turn = radius * draw(st.integers(40, 80)) / 10.0, math.radians(draw(st.integers(60, 150)))
            ccw = draw(st.booleans())
            # The centre is exact to the increment, the end lies on the circle through the start.
            to_left = heading + (0.5 if ccw else -0.5) * math.pi
            i, j = round(size * math.cos(to_left), 3), round(size * math.sin(to_left), 3)
            angle = math.atan2(-j, -i) + (turn if ccw else -turn)
            x, y = i + math.hypot(i, j) * math.cos(angle), j + math.hypot(i, j) * math.sin(angle)
            code = "G03" if ccw else "G02"
            lines.append(f"{code}X{_number(x)}Y{_number(y)}I{_number(i)}J{_number(j)}")
            heading += turn if ccw else -turn
        # Never so little that the rounding of an arc's end moves the corner by more.
        heading += math.radians(draw(st.integers(30, 115))) * draw(st.sampled_from([-1.0, 1.0]))
    length = 5.0 * radius
    lines.append(f"G01X{_number(length * math.cos(heading))}Y{_number(length * math.sin(heading))}")
    lines += [f"G40X{_number(3.0 * radius)}", "G90G00Z50.", "M30", "%", ""]
    return "\n".join(lines)
