"""Random programs in LinuxCNC's words: control flow, parameters, arcs, units, offsets, cycles."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from decimal import Decimal

TOOLS = {1: 1.5, 2: 2.25, 3: 0.75}
"""Lengths of the tools, inch."""


class RandomProgram:
    """Writes one program; the same seed gives the same one.

    `scale` multiplies every length, so that rs274, which prints four decimals, shows more of them.
    """

    def __init__(self, seed: int, scale: int = 1) -> None:
        self._random = random.Random(seed)
        self._scale = scale
        self._lines: list[str] = []
        self._label = 100
        self.inches = self._random.random() < 0.3
        self._unit = 25.4 if self.inches else 1.0
        self._plane = 17
        self._broke = False
        self.pecks = not self.inches

    def text(self) -> str:
        """The program."""
        r = self._random
        self._put(f"G{20 if self.inches else 21} G17 G90 G94 G40 G49 G80 G91.1 (begin)")
        if r.random() < 0.6:
            self._subroutines()
        self._put(f"{self._feed(r.choice([200, 350.5, 1200]))} S1000 M3")
        self._place("G0")
        pieces: list[Callable[[], None]] = [
            self._lines_of_moves, self._arcs, self._arc_both_modes, self._turns, self._loop, self._repeat, self._branch,
            self._do, self._offsets, self._tool, self._dwell, self._cycle, self._incremental, self._inverse_time,
            self._call, self._expressions, self._polar, self._save, self._incremental_cycle, self._turned_plane,
        ]  # fmt: skip
        for _ in range(r.randint(6, 14)):
            r.choice(pieces)()
        self._put(r.choice(["M2", "M30"]))
        return "\n".join(self._lines) + "\n"

    def _put(self, line: str) -> None:
        r = self._random
        if r.random() < 0.1:
            line = line.lower()
        if r.random() < 0.05:
            line += " ; a remark"
        if r.random() < 0.05 and not line.lower().lstrip().startswith("o"):
            line = f"N{r.randint(1, 9999)} {line}"
        self._lines.append(line)

    def _length(self, low: float, high: float) -> str:
        """A length of so many mm in the program's unit."""
        value = self._random.uniform(low, high) / self._unit
        digits = self._random.choice([0, 1, 2, 3, 4, 5])
        text = f"{value:.{digits + (1 if self.inches else 0)}f}"
        return f"{Decimal(text if float(text) != 0.0 else '0.5') * self._scale:f}"

    def _feed(self, value: float) -> str:
        return f"F{Decimal(f'{value / self._unit:.3f}') * self._scale:f}"

    def _place(self, code: str, names: str = "XYZ") -> None:
        self._put(f"{code} " + " ".join(f"{name}{self._length(-60, 60)}" for name in names))

    def _name(self) -> int:
        self._label += 1
        return self._label

    def _lines_of_moves(self) -> None:
        for _ in range(self._random.randint(1, 5)):
            names = "".join(name for name in "XYZ" if self._random.random() < 0.6) or "X"
            self._place(self._random.choice(["G1", "G0", "G01", "g1"]), names)
        self._place("G1", "XY")
        if self._random.random() < 0.5:
            self._place("", self._random.choice(["X", "Y", "XYZ"]))

    def _centre(self) -> tuple[str, str, str]:
        """Names of the two axes of the plane and of the third one."""
        return {17: ("X", "Y", "Z"), 18: ("Z", "X", "Y"), 19: ("Y", "Z", "X")}[self._plane]

    def _turned_plane(self) -> None:
        self._plane = self._random.choice([18, 19])
        self._put(f"G{self._plane}")
        self._arcs()
        self._arc_both_modes()
        self._turns()
        self._plane = 17
        self._put("G17")

    def _arcs(self) -> None:
        """A quarter by I J, half by R, three quarters by R."""
        a, b, _ = self._centre()
        i, j = ("IJK"["XYZ".index(name)] for name in (a, b))
        radius = self._length(3, 20)
        self._put(f"G1 {a}0 {b}0")
        self._put(f"G3 {a}[{radius}] {b}{radius} {i}0 {j}{radius}")
        self._put(f"G2 {a}0 {b}[2*{radius}] R{radius}")
        self._put(f"G1 {a}0 {b}0")
        self._put(f"G{self._random.choice('23')} {a}{radius} {b}{radius} R-{radius}")

    def _arc_both_modes(self) -> None:
        """A full circle and a part by absolute centres, then by increments."""
        a, b, c = self._centre()
        i, j = ("IJK"["XYZ".index(name)] for name in (a, b))
        r = self._random
        x, y, radius = (float(self._length(5, 30)) for _ in range(3))
        begin, end = r.uniform(0, 6), r.uniform(0, 6)
        spots = [(x + radius * math.cos(t), y + radius * math.sin(t)) for t in (begin, end)]
        self._put(f"G1 {a}{spots[0][0]:.6f} {b}{spots[0][1]:.6f}")
        self._put("G90.1")
        rise = f" {c}{self._length(-5, 5)}" if r.random() < 0.5 else ""
        self._put(f"G{r.choice('23')} {a}{spots[1][0]:.6f} {b}{spots[1][1]:.6f} {i}{x:.6f} {j}{y:.6f}{rise}")
        self._put(f"G2 {i}{x:.6f} {j}{y:.6f}")
        self._put("G91.1")
        self._put(f"G3 {i}[{x:.6f}-{spots[1][0]:.6f}] {j}[{y:.6f}-{spots[1][1]:.6f}]")

    def _turns(self) -> None:
        a, b, c = self._centre()
        i, j = ("IJK"["XYZ".index(name)] for name in (a, b))
        radius = self._length(2, 10)
        self._put(f"G1 {a}0 {b}0 {c}0")
        self._put(f"G{self._random.choice('23')} {a}{radius} {b}{radius} {i}{radius} {j}0 {c}-{self._length(1, 9)} P"
                  f"{self._random.randint(2, 4)}")  # fmt: skip

    def _loop(self) -> None:
        label, count = self._name(), self._random.randint(2, 5)
        self._put("#1 = 0")
        self._put(f"O{label} while [#1 LT {count}]")
        self._put("  #1 = [#1 + 1]")
        if self._random.random() < 0.4:
            inner = self._name()
            self._put(f"  O{inner} if [#1 EQ 2]")
            word = self._random.choice(["continue", "break"])
            self._broke = self._broke or word == "break"
            self._put(f"    O{label} {word}")
            self._put(f"  O{inner} endif")
        self._put(f"  G1 X[#1 * {self._length(1, 5)}] Y[SIN[#1 * 30] * {self._length(3, 9)}]")
        self._put(f"O{label} endwhile")

    def _repeat(self) -> None:
        label = self._name()
        self._put(f"O{label} repeat [{self._random.randint(0, 4)}]")
        self._put("G91")
        self._place("G1", "XY")
        self._put("G90")
        self._put(f"O{label} endrepeat")

    def _branch(self) -> None:
        label = self._name()
        self._put(f"#<choice> = {self._random.randint(0, 3)}")
        self._put(f"o{label} if [#<choice> eq 0]")
        self._place("G1")
        self._put(f"o{label} elseif [[#<choice> eq 1] or [#<choice> gt 2]]")
        self._place("G0", "XY")
        self._put(f"o{label} else")
        self._put(f"#<level> = {self._length(-9, 9)}")
        self._put("G1 Z#<level>")
        self._put(f"o{label} endif")

    def _do(self) -> None:
        if self._broke:  # LinuxCNC 2.9.0~pre1 runs a DO loop behind a BREAK once, against its own documentation
            return
        label = self._name()
        self._put("#<_count> = 3")
        self._put(f"O{label} do")
        self._put(f"G1 X[#<_count> * {self._length(2, 4)}] Y[ABS[#<_count> - 5] * {self._length(2, 4)}]")
        self._put("#<_count> = [#<_count> - 1]")
        self._put(f"O{label} while [#<_count> GE 1]")

    def _subroutines(self) -> None:
        self._put("O<corner> sub")
        self._put("  #<width> = [#1 / 2 + #2]")
        self._put("  G1 X#1 Y#2")
        self._put("  X#<width>")
        self._put("  O1 if [#3 LE 0]")
        self._put("    O<corner> return [#1]")
        self._put("  O1 endif")
        self._put("  O<corner> call [#1] [#2 + #<_step>] [#3 - 1]")
        self._put("O<corner> endsub [#<width>]")
        self._put(f"#<_step> = {self._length(1, 3)}")
        self._subs = True

    _subs = False

    def _call(self) -> None:
        if not self._subs:
            return
        self._put(f"O<corner> call [{self._length(1, 20)}] [{self._length(1, 20)}] [{self._random.randint(0, 4)}]")
        self._put("G1 X#<_value> Y[#<_value> / 2]")

    def _expressions(self) -> None:
        a, b = self._length(1, 9), self._length(1, 9)
        self._put(f"#31={a} #32=[{b}]")
        for text in (
            "[#31 + #32 * 2 - #31 / 4]", "[SQRT[#31 ** 2 + #32 ** 2]]", "[#31 * COS[30] - #32 * SIN[-45]]",
            "[ABS[#31 - #32] + [#31 GT #32] * #31]", "[-#31 + ATAN[1]/[2] * #32 / 90]",
            "[#31 * [7 MOD 4] - #32 * [-7 MOD 4]]", "[#31 * ROUND[2.5] + #32 * FIX[-1.5] + #31 * FUP[0.2]]",
            "[#31 * EXP[0.5] + #32 * LN[3] + #31 * TAN[20]]", "[#31 * ACOS[0.3] / 60 + #32 * ASIN[-0.4] / 50]",
            "[#31 * [1 AND 0 OR 1] + #32 * [2 XOR 0] + #31 * 2 ** 3 ** 0.5]", "-#32", "##[31 + 0]",
            "[#31 * EXISTS[#<nothing>] + #32 * [1 NE 1.00001] + #31 * [2 GE 2] ]",
        ):  # fmt: skip
            if self._random.random() < 0.5 and not text.startswith("##"):
                self._put(f"G1 {self._random.choice('XY')}{text}")
        self._put("#33 = #32 #32 = #31 #31 = #33")
        self._put("G1 X#31 Y#32 Z[#33 / 2]")

    def _offsets(self) -> None:
        r = self._random
        choice = r.randint(0, 5)
        if choice == 0:
            self._put(f"G92 X{self._length(-9, 9)} Y{self._length(-9, 9)}")
            self._place("G1")
            self._put(r.choice(["G92.1", f"G92.2\nG1 X{self._length(1, 9)}\nG92.3\nG1 X{self._length(1, 9)}\nG92.1"]))
        elif choice == 1:
            self._put(f"G52 X{self._length(-9, 9)} Z{self._length(-9, 9)}")
            self._place("G1")
            self._put("G52 X0 Z0")
        elif choice == 2:
            number = r.randint(1, 9)
            self._put(f"G10 L2 P{number} X{self._length(-50, 50)} Y{self._length(-50, 50)}")
            self._put(["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"][number - 1])
            self._put(f"G1 X#5420 Y[#5421 + {self._length(1, 5)}]")
            self._put("G1 X[#[5201 + 20 * #5220] / 10]")
        elif choice == 3:
            self._put(f"G10 L20 P{r.choice([0, 1])} X{self._length(-9, 9)}" if not self.inches else "G54")
        elif choice == 4:
            self._put(f"G53 G{r.choice('01')} X{self._length(-9, 9)} Y{self._length(-9, 9)}")
        else:
            self._put(f"G{r.choice('01')} G55 X{self._length(-9, 9)}")
            self._put("G54")
        self._place("G1")

    def _tool(self) -> None:
        if self.inches:  # read at another scale, and the tool table is not
            return
        number = self._random.choice([1, 2, 3])
        self._put(f"T{number} M6")
        self._put("M3")
        self._put(self._random.choice(["G43", "G43 H2", f"G43.1 Z{self._length(1, 30)}"]))
        self._place("G0", "XYZ")
        self._put(f"G1 Z[#5422 - {self._length(1, 3)}] X[#5403]")
        if self._random.random() < 0.5:
            self._put("G49")
            self._place("G0")

    def _dwell(self) -> None:
        r = self._random
        self._put(
            r.choice(
                [
                    "G4 P0.5",
                    "G4 P2",
                    f"G4 P[{r.uniform(0, 3):.4f}]",
                    "G4 P0.0005",
                    f"G04 P1.25 G1 X{self._length(1, 9)}",
                ]
            )
        )

    def _cycle(self) -> None:
        r = self._random
        code = r.choice([81, 82, 85, 86, 89, 84, *([83, 73] if self.pecks else [])])
        top, bottom = float(self._length(1, 4)), -float(self._length(2, 9))
        extra = {82: " P0.25", 86: " P1.5", 89: " P0.75"}.get(code, "")
        if code in {83, 73}:
            extra = f" Q{self._length(0.6, 2)}"
        if code == 84:
            self._put("M3")
        self._put(f"G0 Z{self._length(10, 20) if r.random() < 0.8 else self._length(-3, 0)}")
        self._put(f"{r.choice(['G98', 'G99'])} G{code} X{self._length(-30, 30)} Y{self._length(-30, 30)} Z{bottom} "
                  f"R{top}{extra}")  # fmt: skip
        for _ in range(r.randint(0, 3)):
            self._place("", r.choice(["X", "Y", "XY"]))
        if r.random() < 0.4:
            self._put(f"X{self._length(-30, 30)} R[{top} + {self._length(1, 2)}]")
        if r.random() < 0.4:
            self._put(f"G{r.choice(['98', '99'])} Y{self._length(-30, 30)}")
        self._put("G80")
        self._place("G0")

    def _incremental_cycle(self) -> None:
        self._put(f"G0 Z{self._length(10, 20)}")
        self._put(f"G91 {self._random.choice(['G98', 'G99'])} G81 X{self._length(1, 5)} Y{self._length(1, 5)} "
                  f"Z-{self._length(3, 6)} R-{self._length(2, 5)} L{self._random.randint(1, 4)}")  # fmt: skip
        self._put("G80 G90")
        self._place("G0")

    def _incremental(self) -> None:
        self._put("G91")
        for _ in range(3):
            self._place(self._random.choice(["G1", "G0"]), self._random.choice(["X", "YZ", "XYZ"]))
        radius = self._length(2, 9)
        self._put(f"G2 X{radius} Y{radius} I{radius} J0")
        self._put(f"G3 X{radius} Y{radius} Z{self._length(1, 3)} J{radius} P2")
        self._put("G90")
        self._place("G1")

    def _inverse_time(self) -> None:
        self._place("G1")
        self._put("G93")
        self._put(f"G1 X{self._length(-30, 30)} Y{self._length(-30, 30)} F{self._random.uniform(5, 40):.3f}")
        radius = self._length(2, 9)
        self._put(f"G91 G2 X{radius} Y{radius} I{radius} F{self._random.uniform(5, 40):.3f}")
        self._put(f"G90 G94 {self._feed(300)}")
        self._place("G1")

    def _polar(self) -> None:
        if not self.inches:
            self._put(f"G1 @{self._length(5, 30)} ^{self._random.uniform(-180, 180):.3f}")
            self._put(f"^{self._random.uniform(-180, 180):.3f}")
            self._place("G1", "XY")

    def _save(self) -> None:
        self._put("M70")
        self._put(f"G91 G1 X{self._length(1, 9)}")
        self._put("G99")
        self._put("M72")
        self._place("G1", "XY")
