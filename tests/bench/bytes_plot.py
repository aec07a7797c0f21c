"""A plot of bytes over error as SVG: both axes logarithmic, errors falling to the right as a client sees them."""
import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 860, 520, 78, 24, 46, 58
STYLES = ("#c0392b", "#2c6fbb", "#2e8b57", "#8e5bb5", "#c77f1b", "#5d6d7e", "#1aa5a5")


def decade_ticks(low, high):
    """1, 2 and 5 of each decade"""
    for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1):
        for digit in (1, 2, 5):
            value = digit * 10 ** power
            if low <= value <= high: yield value


def short(value):
    if value >= 1e6: return f"{value / 1e6:g} MB"
    if value >= 1e3: return f"{value / 1e3:g} kB"
    return f"{value:g}"


def text(x, y, words, anchor="middle", size=12, extra=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}"{extra}>{escape(words)}</text>'


def axes(x, y, xs, ys):
    lines = [f'<rect x="{LEFT}" y="{TOP}" width="{WIDTH - LEFT - RIGHT}" height="{HEIGHT - TOP - BOTTOM}" fill="none" stroke="#888"/>']
    for value in decade_ticks(*xs):
        lines.append(f'<path d="M{x(value):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#e4e4e4"/>' + text(x(value), HEIGHT - BOTTOM + 17, f"{value:g}"))
    for value in decade_ticks(*ys):
        lines.append(f'<path d="M{LEFT} {y(value):.1f}H{WIDTH - RIGHT}" stroke="#e4e4e4"/>' + text(LEFT - 7, y(value) + 4, short(value), "end"))
    lines.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14, "two-sided RMS error, voxels (finer to the right)", size=13))
    lines.append(text(0, 0, "bytes fetched", size=13, extra=f' transform="translate(18 {(TOP + HEIGHT - BOTTOM) / 2:.0f}) rotate(-90)"'))
    return lines


def steps(places):
    """As stairs: who wants less error than a point has pays for the next one"""
    path = f"M{places[0][0]:.1f} {places[0][1]:.1f}"
    return path + "".join(f"V{b:.1f}H{a:.1f}" for a, b in places[1:])


def curve(x, y, name, points, colour, index):
    """points: errors falling"""
    wide, radius = (3, 3.2) if index == 0 else (1.4, 1.8)
    if len(points) == 1: radius = 5
    places = [(x(e), y(b)) for e, b in points]
    lines = [f'<path d="{steps(places)}" fill="none" stroke="{colour}" stroke-width="{wide}"/>'] if len(places) > 1 else []
    lines += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{radius}" fill="{colour}"><title>{escape(name)}: {e:.3f} voxel, {n:,} B</title></circle>'
              for (a, b), (e, n) in zip(places, points)]
    row = TOP + 20 + 19 * index
    mark = f'<path d="M{LEFT + 14} {row - 4}h22" stroke="{colour}" stroke-width="{wide}"/>' if len(places) > 1 else \
        f'<circle cx="{LEFT + 25}" cy="{row - 4}" r="{radius}" fill="{colour}"/>'
    lines.append(mark + text(LEFT + 42, row, name, "start"))
    return lines


def svg(title, curves):
    """curves: {name: [(rms, bytes), ...]}; the first one is drawn strongest. The plot as text"""
    curves = {name: sorted(((max(e, 1e-3), b) for e, b in points), reverse=True) for name, points in curves.items() if points}
    errors, sizes = ([p[k] for points in curves.values() for p in points] for k in (0, 1))
    xs, ys = (min(errors) / 1.1, max(errors) * 1.1), (min(sizes) / 1.4, max(sizes) * 1.4)
    def scale(value, low, high, start, end): return start + (end - start) * math.log(value / low) / math.log(high / low)
    x = lambda e: scale(e, *xs, WIDTH - RIGHT, LEFT)
    y = lambda b: scale(b, *ys, HEIGHT - BOTTOM, TOP)
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" fill="#222">',
             f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>', text(WIDTH / 2, 27, title, size=16)]
    lines += axes(x, y, xs, ys)
    for i, (name, points) in reversed(list(enumerate(curves.items()))): lines += curve(x, y, name, points, STYLES[i % len(STYLES)], i)
    return "\n".join(lines + ["</svg>"]) + "\n"
