// The plots of the statistics panel. They load when the panel is first opened.
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import type { StatsHistory } from '../stats/history';
import type { StatsSnapshot } from '../stats/metrics';
import { text } from '../text';

type Stage = keyof StatsSnapshot['stages_ms'];

/** Stages in the order of a frame, with colours for both light and dark pages. */
const stages: readonly (readonly [stage: Stage, colour: string])[] = [
  ['wait', '#8d99ae'],
  ['render', '#e07a3f'],
  ['encode', '#d9b23a'],
  ['send', '#6fae5c'],
  ['network', '#3d9fa8'],
  ['decode', '#4b7bd6'],
  ['present', '#9a68c4'],
];

const height_px = 104;

function style(element: Element, name: string): string {
  return getComputedStyle(element).getPropertyValue(name).trim();
}

/** Colours come from the page's style sheet, light or dark. */
function axis(host: Element, label: string, more: Partial<uPlot.Axis> = {}): uPlot.Axis {
  const line = style(host, '--line');
  return {
    stroke: style(host, '--ink-soft'),
    grid: { stroke: line, width: 1 },
    ticks: { show: false },
    font: '11px system-ui, sans-serif',
    size: 34,
    label,
    labelSize: 14,
    labelFont: '11px system-ui, sans-serif',
    labelGap: 0,
    ...more,
  };
}

const time_axis = (host: Element): uPlot.Axis =>
  axis(host, '', {
    size: 18,
    gap: 2,
    labelSize: 0,
    values: (_, ticks) => ticks.map((s) => `${s} s`),
  });

const line = (label: string, stroke: string, scale: string): uPlot.Series => ({
  label,
  stroke,
  scale,
  width: 1.5,
  points: { show: false },
});

interface Chart {
  readonly plot: uPlot;
  readonly data: (history: StatsHistory) => (number | null)[][];
}

export class StatsCharts {
  private readonly charts_: Chart[];

  constructor(private readonly host_: HTMLElement) {
    this.charts_ = [this.latency(), this.rates(), this.caches()];
    new ResizeObserver(() => {
      const width = this.width();
      for (const { plot } of this.charts_) plot.setSize({ width, height: height_px });
    }).observe(host_);
  }

  show(history: StatsHistory): void {
    const times_s = history.samples.map(({ time_s }) => time_s);
    for (const { plot, data } of this.charts_) {
      plot.setData([times_s, ...data(history)] as uPlot.AlignedData);
    }
  }

  /** Stages are stacked, so the topmost line is close to the motion to photon. */
  private latency(): Chart {
    const upwards = stages.map((_, i) => stages.slice(0, i + 1).map(([stage]) => stage));
    const total =
      (names: readonly Stage[]) =>
      ({ stages_ms }: StatsSnapshot): number =>
        names.reduce((sum, name) => sum + (Number.isFinite(stages_ms[name]) ? stages_ms[name] : 0), 0);
    const drawn = stages.map(([stage, colour], i) => ({ stage, colour, names: upwards[i]! })).reverse();
    return {
      plot: this.plot(
        text.plots.latency,
        drawn.map(({ stage, colour }) => ({ ...line(text.stages[stage].label, colour, 'y'), fill: colour })),
        [axis(this.host_, 'ms')],
      ),
      data: (history) => drawn.map(({ names }) => history.column(total(names))),
    };
  }

  private rates(): Chart {
    const right = { side: 1, scale: 'bits', grid: { show: false } } as const;
    return {
      plot: this.plot(
        text.plots.rates,
        [line(text.plots.fps, '#4b7bd6', 'y'), line(text.plots.bitrate, '#e07a3f', 'bits')],
        [axis(this.host_, 'fps'), axis(this.host_, 'Mb/s', right)],
      ),
      data: (history) => [
        history.column((s) => s.fps_shown),
        history.column((s) => s.bitrate_kbps / 1000),
      ],
    };
  }

  private caches(): Chart {
    const right = { side: 1, scale: 'share', grid: { show: false } } as const;
    return {
      plot: this.plot(
        text.plots.caches,
        [line(text.plots.window, '#6fae5c', 'y'), line(text.plots.sub_share, '#9a68c4', 'share')],
        [axis(this.host_, 'W'), axis(this.host_, '%', right)],
      ),
      data: (history) => [
        history.column((s) => s.window),
        history.column((s) => s.sub_share * 100),
      ],
    };
  }

  private plot(title: string, series: uPlot.Series[], axes: uPlot.Axis[]): uPlot {
    const heading = document.createElement('h3');
    heading.textContent = title;
    this.host_.append(heading);
    const from_zero: uPlot.Scale = { range: (_, _low, high) => [0, Math.max(high * 1.1, 1)] };
    return new uPlot(
      {
        width: this.width(),
        height: height_px,
        series: [{}, ...series],
        axes: [time_axis(this.host_), ...axes],
        scales: { x: { time: false }, y: from_zero, bits: from_zero, share: { range: [0, 100] } },
        cursor: { show: false },
        legend: { live: false },
      },
      [[], ...series.map(() => [])] as unknown as uPlot.AlignedData,
      this.host_,
    );
  }

  private width(): number {
    return Math.max(120, this.host_.clientWidth);
  }
}
