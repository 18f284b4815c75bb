"""Two examples of each command, which stand below its options and in its man page."""

from __future__ import annotations

EXAMPLES: dict[str, tuple[str, ...]] = {
    "convert": (
        "shapegcode convert part.nc -m vx500 -o shaped.nc",
        "shapegcode convert part.nc -m mine.toml -o shaped.nc --max-bytes 256k --html result.html",
    ),
    "shaper": (
        "shapegcode shaper --mode 46:0.02±5% --mode 131:0.02 --block-period 5ms",
        "shapegcode shaper -m mine.toml --objective robust --plots plots",
    ),
    "simulate": (
        "shapegcode simulate part.nc -m vx500 --html motion.html",
        "shapegcode simulate part.nc -m mine.toml --plant feed-drive --npz motion.npz --plots plots",
    ),
    "feed": (
        "shapegcode feed part.nc -m vx500 --tool T8.toml --stock block.toml -o part-feed.nc",
        "shapegcode feed part.nc -m mine.toml --tool T8.toml --stock block.toml -o out.nc --margin 3%",
    ),
    "expand": (
        "shapegcode expand part.nc -m vx500 -o plain.nc",
        "shapegcode expand memory.nc -m mine.toml --program O1234 -o - --compensation keep",
    ),
    "measure": (
        "shapegcode measure part.nc shaped.nc -m vx500 --tool-diameter 3mm --plots plots",
        "shapegcode measure part.nc -m mine.toml --tool-diameter 10mm --lines 20-40",
    ),
    "time": (
        "shapegcode time part.nc -m vx500",
        "shapegcode time part.nc -m mine.toml --override 80% --csv blocks.csv",
    ),
    "check": (
        "shapegcode check part.nc -m vx500",
        "shapegcode check memory.nc -m mine.toml --program all --json check.json",
    ),
    "compare": (
        "shapegcode compare part.nc shaped.nc --allow feeds,blocks,path=30um",
        "shapegcode compare part.nc shaped.nc -m mine.toml --allow feeds,blocks,path=0.02mm,calls --json compare.json",
    ),
    "batch": (
        "shapegcode batch parts -m mine.toml -o shaped --html pages",
        "shapegcode batch 'parts/**/*.nc' -m a.toml -m b.toml -o times --command time --resume",
    ),
    "study": (
        "shapegcode study STUDY.toml --plots plots",
        "shapegcode study STUDY.toml -m mine.toml -n 10000 --html study.html --csv draws.csv",
    ),
    "optimize": (
        "shapegcode optimize STUDY.toml",
        "shapegcode optimize STUDY.toml -m mine.toml --at-least 99% --html optimum.html --json optimum.json",
    ),
    "setup": (
        "shapegcode setup -o mine.toml",
        "shapegcode setup --answers answers.toml -o mine.toml --force",
    ),
    "machine": (
        "shapegcode machine init vx500 -o mine.toml",
        "shapegcode machine import CNC-PARA.TXT --from vx500 -o mine.toml",
    ),
    "machine init": (
        "shapegcode machine init",
        "shapegcode machine init vx500 -o mine.toml --full",
    ),
    "machine import": (
        "shapegcode machine import CNC-PARA.TXT -o mine.toml",
        "shapegcode machine import CNC-PARA.TXT TOOLOFST.TXT MACRO.TXT --from vx500 -o mine.toml",
    ),
    "machine show": (
        "shapegcode machine show vx500",
        "shapegcode machine show mine.toml --for part.nc",
    ),
    "machine diff": (
        "shapegcode machine diff vx500 mine.toml",
        "shapegcode machine diff old.toml mine.toml --json diff.json",
    ),
    "machine schema": (
        "shapegcode machine schema -o machine.schema.json",
        "shapegcode machine schema tool -o tool.schema.json",
    ),
    "characterize": (
        "shapegcode characterize --write tests -m mine.toml --box 0:100,0:100,0:20",
        "shapegcode characterize --fit tests/RESULTS.toml -m mine.toml -o measured.toml",
    ),
    "identify": (
        "shapegcode identify tap1.csv tap2.csv tap3.csv --axis x --update mine.toml --plots plots",
        "shapegcode identify --tap-plan -m mine.toml",
    ),
    "testcut": (
        "shapegcode testcut taper -m vx500 --tool em8.toml -S 1800 -F 216 -a 15 -o TAPER.NC",
        "shapegcode testcut fit pass1.csv pass2.csv pass3.csv --cut TAPER.json -o cutting.toml",
    ),
    "testcut taper": (
        "shapegcode testcut taper -m vx500 --tool em8.toml -S 1800 -F 216 -a 15 -o TAPER.NC",
        "shapegcode testcut taper -m mine.toml --tool em8.toml -F 108,216,432 -a 10 -o TAPER.NC",
    ),
    "testcut corner": (
        "shapegcode testcut corner -m vx500 --tool em8.toml -F 216 -a 15 -o CORNER.NC",
        "shapegcode testcut corner -m mine.toml --tool em8.toml -F 216 -a 15 --interval 0.4 -o CORNER.NC",
    ),
    "testcut interval": (
        "shapegcode testcut interval -m vx500 --tool em8.toml -F 216 -a 15 -o INTERVAL.NC",
        "shapegcode testcut interval -m mine.toml --tool em8.toml -F 216 -a 15 --intervals 0.3,0.6 -o I.NC",
    ),
    "testcut fit": (
        "shapegcode testcut fit pass1.csv pass2.csv pass3.csv --cut TAPER.json -o cutting.toml",
        "shapegcode testcut fit 2=pass2.csv --cut CORNER.json --plots plots",
    ),
    "report": (
        "shapegcode report result.json",
        "shapegcode report result.json -o result.html --html-script beside",
    ),
    "completion": ("shapegcode completion bash", "shapegcode completion fish"),
    "demo": ("shapegcode demo path", "shapegcode demo path --json path.json --html path.html"),
}
"""By command and action: what a user could type. Each is read by that command's parser in a test."""
