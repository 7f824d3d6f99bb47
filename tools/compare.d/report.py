"""What tools/compare found, as Markdown, JSON and SVG."""

from html import escape
from math import log2


class Report:
    """Rows of ratios: ours over theirs."""

    def __init__(self):
        self.rows, self.notes, self.absent = [], {}, []

    def add(self, key, what, against, mine, other, apart=None):
        """A row of seconds; without the other's it holds ours alone."""
        row = {"key": f"{key}_vs_{against}", "what": what, "against": against, "unit": "s", "apart": apart}
        ours, theirs = mine["wall"], other and other["wall"]
        quiet = mine["quiet"] / other["quiet"] if other and mine["quiet"] and other["quiet"] else None
        self.rows.append({**row, "ours": ours, "theirs": theirs, "ratio": ours / theirs if theirs else None, "quiet": quiet})

    def add_memory(self, key, what, against, ours, theirs):
        """A row of bytes."""
        row = {"key": f"{key}_vs_{against}", "what": what, "against": against, "unit": "MiB", "apart": None}
        self.rows.append({**row, "ours": ours / 2**20, "theirs": theirs / 2**20, "ratio": ours / theirs, "quiet": None})

    def missing(self, text):
        """Says what is not in the tables."""
        self.absent.append(text)

    def markdown(self):
        """Tables for people."""
        lines = [f"{name}: {text}  " for name, text in self.notes.items()]
        lines += ["", "| what | against | ours | theirs | ours / theirs | quiet | relative error |"]
        lines += ["|---|---|---:|---:|---:|---:|---:|"]
        for row in self.rows:
            cells = [row["what"], row["against"], amount(row["ours"], row["unit"]), amount(row["theirs"], row["unit"])]
            cells += [number(row["ratio"], ".2f"), number(row["quiet"], ".2f"), number(row["apart"], ".1e")]
            lines.append(f"| {' | '.join(cells)} |")
        lines += ["", *(f"not measured: {text}" for text in self.absent)]
        return "\n".join(lines)

    def numbers(self):
        """Everything, for programs."""
        ratios = {name: {row["key"]: row[name] for row in self.rows if row[name] is not None} for name in ("ratio", "quiet")}
        about = {"notes": self.notes, "rows": self.rows, "missing": self.absent}
        return {"ratios": ratios["ratio"], "quiet_ratios": ratios["quiet"], **about}

    def svg(self):
        """Bars of the ratios on a logarithmic axis from 1/32 to 32; left of the middle we are faster."""
        rows = [row for row in self.rows if row["ratio"]]
        left, unit, height = 420, 40, 22
        place = lambda power: left + (power + 5) * unit
        total = 50 + height * len(rows)
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{place(5) + 70}" height="{total}"'
        out = [f'{head} font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>']
        for power in range(-5, 6):
            label = str(2**power) if power >= 0 else f"1/{2**-power}"
            out.append(f'<path d="M{place(power)} 30V{total - 10}" stroke="{"black" if power == 0 else "lightgrey"}"/>')
            out.append(f'<text x="{place(power)}" y="22" text-anchor="middle">{label}</text>')
        for index, row in enumerate(rows):
            end = place(max(-5, min(5, log2(row["ratio"]))))
            start, y = min(end, place(0)), 36 + index * height
            colour = {"pytorch": "#c7572b", "burn": "#3973ac"}.get(row["against"], "#777777")
            out.append(f'<rect x="{start}" y="{y}" width="{abs(end - place(0))}" height="14" fill="{colour}"/>')
            name = escape(f"{row['what']} / {row['against']}")
            out.append(f'<text x="{left - 10}" y="{y + 11}" text-anchor="end">{name}</text>')
            out.append(f'<text x="{max(end, place(0)) + 5}" y="{y + 11}">{row["ratio"]:.2f}</text>')
        return "\n".join([*out, "</svg>\n"])


def number(value, form):
    """A number, or a dash for none."""
    return "-" if value is None else format(value, form)


def amount(value, unit):
    """A number with its unit, small times in milliseconds."""
    if value is None:
        return "-"
    if unit == "s" and value < 1:
        return f"{value * 1e3:.3g} ms"
    return f"{value:.3g} {unit}" if unit == "s" else f"{value:.0f} {unit}"
