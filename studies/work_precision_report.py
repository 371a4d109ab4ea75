"""What studies/work_precision.py writes: table.csv, table.h5, figures and report.md."""
import csv
import math
import os

import h5py
import numpy as np

# Okabe and Ito's colours, which the colour-blind can tell apart
COLOURS = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000']
MARKERS = ['o', 's', '^', 'D', 'v', 'P', 'X', '*']
LINES = ['-', '--', ':', '-.', (0, (5, 1, 1, 1, 1, 1))]
# the first that varies is told by colour, the second by the marker, the third by the line, the others by size and filling
DISPLAYED = ['scheme', 'order', 'quadrature', 'geometry', 'discretization', 'theta_relative', 'stop rule', 'linear_solver',
             'threads', 'size']
SAME = {'theta_relative': ['theta_relative', 'theta', 'theta_default'], 'stop rule': ['tolerance', 'stop_rule']}
NOT_SAID = 'as in the scene'
PARTS = {'error_bound': 'iteration (guaranteed bound)', 'error_penalty': 'penalty (estimate)',
         'error_discretization': 'discretization (estimate)'}
COLUMNS = ['size', 'order', 'discretization', 'quadrature', 'geometry', 'theta_relative', 'theta', 'theta_default', 'stop_rule', 'tolerance',
           'scheme', 'linear_solver', 'threads', 'elements', 'unknowns', 'constraints', 'exit', 'converged', 'scheme_used',
           'iterations', 'body_solves', 'seconds', 'seconds_min', 'seconds_max', 'repeats', 'seconds_process']
KNOWN_LABELS = {'energy': 'relative error, energy norm', 'a_error': 'relative error, contact size',
                'p0_error': 'relative error, peak pressure', 'profile_error': 'relative error, pressure (mean square)'}


def duration(seconds):
    """A time as people say it."""
    if seconds < 90:
        return '%.0f s' % seconds
    return '%.0f min' % (seconds/60) if seconds < 5400 else '%.1f h' % (seconds/3600)


def number(value):
    """A number for people; a dash where there is none."""
    if value is None or isinstance(value, float) and math.isnan(value):
        return '-'
    if isinstance(value, float):
        return '%.3g' % value
    return str(value)


def columns_of(rows, errors):
    """All columns in order: settings, sizes, cost, errors, times of the parts, what is left, message."""
    names = [name for name in COLUMNS if any(row.get(name) is not None for row in rows)]
    for group in (errors, PARTS, sorted({name for row in rows for name in row if name.startswith('seconds_')}),
                  sorted({name for row in rows for name in row} - {'message', 'libraries'} - set(COLUMNS))):
        names += [name for name in group if name not in names and any(row.get(name) is not None for row in rows)]
    return names + ['message']


def write_table(grid, rows, facts):
    """table.csv and table.h5."""
    names = columns_of(rows, grid.error)
    new = grid.output / 'table.csv.new'
    with open(new, 'w', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([row.get(name) for name in names] for row in rows)
    os.replace(new, grid.output / 'table.csv')
    new = grid.output / 'table.h5.new'
    with h5py.File(new, 'w') as file:
        file.attrs.update(facts)
        file.attrs['grid_text'] = grid.text
        table = file.create_group('table')
        for name in names:
            values = [row.get(name) for row in rows]
            if any(isinstance(value, str) for value in values):
                table.create_dataset(name, data=['' if v is None else str(v) for v in values], dtype=h5py.string_dtype())
            else:
                table.create_dataset(name, data=np.array([np.nan if v is None else v for v in values], float))
    os.replace(new, grid.output / 'table.h5')


# Figures

def label_of(grid, name):
    """What an error is called on an axis."""
    if grid.error_label:
        return grid.error_label[grid.error.index(name)]
    return KNOWN_LABELS.get(name, name.replace('_', ' '))


def shown(key, row):
    """What a row shows for one of DISPLAYED: the value of the key, or of those keys that say the same thing."""
    for name in SAME.get(key, [key]):
        if row.get(name) is not None:
            text = value_text(name, row[name])
            return text if name == key or name == 'theta_relative' else '%s %s' % (name.replace('_', ' '), text)
    return value_text(key, None)


def value_text(key, value):
    """A setting in the legend."""
    if value is None:
        return NOT_SAID
    if key == 'order':
        return {1: 'linear elements', 2: 'quadratic elements'}.get(value, str(value))
    return '%g' % value if isinstance(value, float) else str(value)


class Style:
    """Colour, marker and line of each curve, and the legend that tells them."""

    def __init__(self, grid, rows):
        self.values = {}
        for key in DISPLAYED:
            values = list(dict.fromkeys(shown(key, row) for row in rows))
            so_far = {tuple(shown(name, row) for name in self.values) for row in rows}
            with_it = {tuple(shown(name, row) for name in [*self.values, key]) for row in rows}
            # left out: what does not vary, what varies along the curve, what follows from the settings before it
            if len(values) > 1 and grid.along not in SAME.get(key, [key]) and len(with_it) > len(so_far):
                self.values[key] = values
        self.keys = list(self.values)

    def of(self, row):
        """Arguments of plot for the curve of a row."""
        style = {'color': COLOURS[0], 'marker': MARKERS[0], 'linestyle': '-', 'markersize': 5.5}
        for place, key in enumerate(self.keys):
            style.update(self.channel(place, self.values[key].index(shown(key, row))))
        return style

    @staticmethod
    def channel(place, index):
        """How the index-th value of the setting at this place looks."""
        if place == 0:
            return {'color': COLOURS[index % len(COLOURS)]}
        if place == 1:
            return {'marker': MARKERS[index % len(MARKERS)]}
        if place == 2:
            return {'linestyle': LINES[index % len(LINES)]}
        if place == 3:
            return {'markersize': 4 + 2.5*index}
        return {'markerfacecolor': 'none' if index % 2 else None}

    def legend(self, figure, plt, extra=()):
        """The legend, right of the panels."""
        handles, texts = [], []

        def head(text):
            handles.append(plt.Line2D([], [], linestyle='none'))
            texts.append(text)

        for place, key in enumerate(self.keys):
            head(('' if not handles else '\n') + r'$\bf{%s}$' % key.replace('_', r'\ '))
            for index, value in enumerate(self.values[key]):
                grey = {'color': '#555555', 'marker': 'o' if place != 2 else None, 'linestyle': '-', 'markersize': 5.5}
                grey.update(self.channel(place, index))
                handles.append(plt.Line2D([], [], **grey))
                texts.append(value)
        for line, text in extra:
            handles.append(line)
            texts.append(text)
        if handles:
            figure.legend(handles, texts, loc='center left', bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8,
                          handlelength=2.6)


def curves_of(grid, rows):
    """Rows that converged, as curves: lists in the order in which the grid's main setting stands."""
    curves = {}
    for row in rows:
        if row.get('converged') and row.get('seconds') is not None:
            key = tuple((name, row[name]) for name in COLUMNS[:13] if name != grid.along and name in row)
            curves.setdefault(key, []).append(row)
    for curve in curves.values():
        curve.sort(key=lambda row: grid.axes[grid.along].index(row[grid.along]))
    return [curve for _, curve in sorted(curves.items(), key=lambda item: str(item[0]))]


def positive(curve, *names, zero=False):
    """Arrays of some columns where all are there and above 0 (zero: or 0)."""
    kept = [row for row in curve if all(isinstance(row.get(name), (int, float)) and (row[name] > 0 or zero and row[name] == 0)
                                        for name in names)]
    return kept, [np.array([row[name] for row in kept], float) for name in names]


def ranges(axes):
    """Logarithmic axes with a grid, and limits that hold a few ticks."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.grid(True, which='major', color='#cccccc', linewidth=0.6)
    axes.grid(True, which='minor', color='#eeeeee', linewidth=0.4)
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high/low < 30 else (1, 3) if high/low < 300 else (1,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: '%g' % value))
        axis.set_minor_formatter(NullFormatter())
    axes.tick_params(labelsize=8)


def panels_of(plt, n, **options):
    """A figure and its n panels, in one row, or in rows of two where there are more than three."""
    columns = n if n < 4 else 2
    figure, all_axes = plt.subplots(-(-n//columns), columns, figsize=(4.1*columns, 3.4*-(-n//columns)), squeeze=False,
                                    constrained_layout=True, **options)
    for axes in all_axes.flat[n:]:
        axes.set_visible(False)
    return figure, all_axes.flat[:n]


def saved(figure, plt, path):
    """Write a figure as a small PNG, with 128 colours; its name."""
    from PIL import Image
    figure.savefig(path, dpi=110, bbox_inches='tight')
    plt.close(figure)
    with Image.open(path) as image:
        small = image.convert('RGB').quantize(128)
    small.save(path, optimize=True)
    return path.name


def figure_of(grid, curves, style, plt, cost, cost_label, name):
    """One figure: a panel for each error, error against cost."""
    panels = [error for error in grid.error if any(positive(curve, cost, error)[0] for curve in curves)]
    if not panels:
        return None
    figure, all_axes = panels_of(plt, len(panels))
    for axes, error in zip(all_axes, panels):
        for curve in curves:
            kept, (x, y) = positive(curve, cost, error)
            if len(kept):
                look = style.of(kept[0])
                axes.plot(x, y, linewidth=1.3, markeredgecolor=look['color'], **look)
                if cost == 'seconds':
                    low, high = (np.array([row[k] for row in kept]) for k in ('seconds_min', 'seconds_max'))
                    axes.hlines(y, low, high, color=look['color'], linewidth=0.8, alpha=0.6)
        axes.set_xlabel(cost_label, fontsize=9)
        axes.set_ylabel(label_of(grid, error), fontsize=9)
        ranges(axes)
    figure.suptitle(grid.title, fontsize=10)
    style.legend(figure, plt)
    return saved(figure, plt, grid.output / name)


def figure_of_parts(grid, curves, style, plt):
    """The parts of the error that dotyk reports, each in a panel, and the measured one in the energy norm beside them."""
    panels = [part for part in PARTS if any(positive(curve, 'seconds', part, zero=True)[0] for curve in curves)]
    measured = ['energy'] if 'energy' in grid.error and any(positive(curve, 'seconds', 'energy')[0] for curve in curves) else []
    if not panels:
        return None
    columns = panels + measured
    figure, all_axes = panels_of(plt, len(columns), sharey=True)
    # Bounds of the iteration are often far below all else: they are drawn at a floor below the other parts.
    others = [y for part in columns if part != 'error_bound' for curve in curves for y in positive(curve, 'seconds', part)[1][1]]
    floor = min(others, default=1e-13)/1e2
    for axes, part in zip(all_axes, columns):
        for curve in curves:
            kept, (x, y) = positive(curve, 'seconds', part, zero=True)
            if len(kept):
                look = style.of(kept[0])
                axes.plot(x, np.maximum(y, floor), linewidth=1.3, markeredgecolor=look['color'], **look)
        axes.axhline(floor, color='#999999', linewidth=0.8, linestyle=':')
        axes.set_xlabel('wall time [s]', fontsize=9)
        axes.set_title('measured, all parts together' if part == 'energy' else PARTS[part], fontsize=9)
        ranges(axes)
    for axes in all_axes[::2] if len(columns) > 3 else all_axes[:1]:
        axes.set_ylabel('relative error in the energy norm', fontsize=9)
    figure.suptitle(grid.title + ': parts of the error', fontsize=10)
    style.legend(figure, plt)
    return saved(figure, plt, grid.output / 'parts.png')


def write_figures(grid, rows):
    """All figures; their names and captions."""
    import matplotlib
    matplotlib.use('Agg')
    import matplotlib.pyplot as plt
    curves = curves_of(grid, rows)
    style = Style(grid, [row for row in rows if any(row in curve for curve in curves)])
    along = grid.along.replace('_', ' ')
    made = [(figure_of(grid, curves, style, plt, 'seconds', 'wall time [s]', 'time.png'),
             'Error against wall time, along each curve %s; bars from the least to the largest of the repeated runs.' % along),
            (figure_of(grid, curves, style, plt, 'body_solves', 'solves of each body', 'solves.png'),
             'Error against the number of solves of each body.'),
            (figure_of_parts(grid, curves, style, plt),
             'What the error is made of, as dotyk reports it; what is below the dotted line is drawn on it.')]
    for name in ('time.png', 'solves.png', 'parts.png'):
        if name not in [name for name, _ in made]:
            (grid.output / name).unlink(missing_ok=True)
    return [(name, caption) for name, caption in made if name]


# Report

def markdown(header, lines):
    """A table in Markdown."""
    return ['| ' + ' | '.join(header) + ' |', '|' + '---|'*len(header), *['| ' + ' | '.join(line) + ' |' for line in lines], '']


def setting_text(grid, row):
    """What tells a point from the others."""
    return ', '.join(value_text(key, row[key]) if key == 'order' else '%s %s' % (key.replace('_', ' '), value_text(key, row[key]))
                     for key in grid.varying if row[key] is not None)


def cheapest(grid, rows):
    """For each error, the fastest run that is as good as 10 %, 5 %, 2 %, 1 % ..."""
    lines = []
    for error in grid.error:
        good = [row for row in rows if row.get('converged') and row.get(error) is not None and row.get('seconds')]
        before = None
        for level in (digit*10.0**-power for power in range(2, 8) for digit in (10, 5, 2)):
            within = [row for row in good if row[error] <= level]
            best = min(within, key=lambda row: row['seconds'], default=None)
            if best is not None and best is not before:
                lines.append([label_of(grid, error), '%g' % level, number(float(best[error])), number(float(best['seconds'])),
                              number(best.get('body_solves')), number(best.get('unknowns')), setting_text(grid, best)])
            before = best
    return lines


def write_report(grid, rows, facts, figures):
    """report.md."""
    omitted = [row for row in rows if not row.get('converged') or row.get('message')]
    text = ['# %s: error against cost' % grid.title, '',
            '%d points of the grid `%s`, %d runs of each; %d converged; %d under "Omissions".' % (
                len(rows), facts['grid'], grid.repeat, sum(1 for row in rows if row.get('converged')), len(omitted)), '']
    text += ['- %s: %s' % (name.replace('_', ' '), value) for name, value in facts.items() if name != 'grid'] + ['']
    for name, caption in figures:
        text += ['![%s](%s)' % (caption, name), '', caption, '']
    lines = cheapest(grid, rows)
    if lines:
        text += ['## What a smaller error costs', '', 'The fastest run within each error.', '']
        text += markdown(['error', 'within', 'found', 'wall time [s]', 'solves', 'unknowns', 'settings'], lines)
    keys = [key for key in COLUMNS[:13] if key in grid.varying]
    parts = [part for part in PARTS if any(row.get(part) is not None for row in rows)]
    parts += [name for name in ('estimate_over_error',) if any(row.get(name) is not None for row in rows)]
    header = [key.replace('_', ' ') for key in keys] + ['unknowns', 'steps', 'solves', 'wall time [s]', 'least', 'largest'] + [
        error.replace('_', ' ') for error in grid.error] + [part.replace('_', ' ') for part in parts] + ['converged']
    names = keys + ['unknowns', 'iterations', 'body_solves', 'seconds', 'seconds_min', 'seconds_max'] + grid.error + parts
    text += ['## Table', '', 'All columns are in `table.csv` and `table.h5`; errors are absolute values, the estimate is the root of the sum of',
             'the squares of the parts.', '']
    lines = [[value_text(name, row[name]) if name in keys and name != 'order' else number(row.get(name)) for name in names]
             + ['yes' if row.get('converged') else 'no'] for row in rows]
    text += markdown(header, [['-' if cell == NOT_SAID else cell for cell in line] for line in lines])
    text += ['## Omissions', '']
    if omitted:
        text += ['Points that failed, did not converge, ran out of time, or lack an error. The figures leave out those that',
                 'did not converge.', '']
        text += markdown(['point', 'exit code', 'why'], [[setting_text(grid, row) or 'the only one', number(row.get('exit')),
                                                          row.get('message', '').replace('|', '/') or '-'] for row in omitted])
    else:
        text += ['None: every point of the grid converged.', '']
    new = grid.output / 'report.md.new'
    new.write_text('\n'.join(text))
    os.replace(new, grid.output / 'report.md')


def write_all(grid, rows, facts):
    """Table, figures, report. Added is what the estimates of all parts come to, and its ratio to the measured error."""
    for row in rows:
        parts = [row.get(part) for part in PARTS]
        if None not in parts:
            row['estimate'] = math.sqrt(sum(part**2 for part in parts))
            if 'energy' in grid.error and row.get('energy'):
                row['estimate_over_error'] = row['estimate']/row['energy']
    write_table(grid, rows, facts)
    write_report(grid, rows, facts, write_figures(grid, rows))
