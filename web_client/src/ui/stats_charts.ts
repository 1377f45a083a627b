// The plots of the statistics panel. They load when the panel is first opened.
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { sum } from '../base/time_window';
import { make } from '../page/dom';
import type { StatsHistory } from '../stats/history';
import { stages, type Stage, type StatsSnapshot } from '../stats/metrics';
import { number } from '../text/number';
import { operator } from '../text/operator';

/** For both light and dark pages. */
const colours: Readonly<Record<Stage, string>> = {
  wait: '#8d99ae',
  render: '#e07a3f',
  encode: '#d9b23a',
  send: '#6fae5c',
  network: '#3d9fa8',
  decode: '#4b7bd6',
  present: '#9a68c4',
};

const height_px = 104;

function style(element: Element, name: string): string {
  return getComputedStyle(element).getPropertyValue(name).trim();
}

/** Colours come from the page's style sheet at each drawing, because it may turn light or dark. */
function axis(host: Element, label: string, more: Partial<uPlot.Axis> = {}): uPlot.Axis {
  return {
    stroke: () => style(host, '--ink-soft'),
    grid: { stroke: () => style(host, '--line'), width: 1 },
    ticks: { show: false },
    font: '11px system-ui, sans-serif',
    size: 34,
    values: (_, ticks) => ticks.map((value) => number(value)),
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
    values: (_, ticks) => ticks.map((s) => `${number(s)} ${operator.units.seconds}`),
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
    this.charts_ = [this.latency(), this.rates()];
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      for (const { plot } of this.charts_) plot.redraw();
    });
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
    const drawn = [...stages].reverse();
    const up_to =
      (last: Stage) =>
      ({ stages_ms }: StatsSnapshot): number =>
        sum(
          stages
            .slice(0, stages.indexOf(last) + 1)
            .map((stage) => stages_ms[stage])
            .filter(Number.isFinite),
        );
    return {
      plot: this.plot(
        operator.plots.latency,
        drawn.map((stage) => ({
          ...line(operator.stages[stage].label, colours[stage], 'y'),
          fill: colours[stage],
        })),
        [axis(this.host_, operator.units.milliseconds)],
      ),
      data: (history) => drawn.map((stage) => history.column(up_to(stage))),
    };
  }

  /** Bits have a scale of their own, at the right. */
  private rates(): Chart {
    return {
      plot: this.plot(
        operator.plots.rates,
        [line(operator.plots.fps, '#4b7bd6', 'y'), line(operator.plots.bitrate, '#e07a3f', 'bits')],
        [
          axis(this.host_, operator.units.fps),
          axis(this.host_, operator.units.megabits, {
            side: 1,
            scale: 'bits',
            grid: { show: false },
          }),
        ],
      ),
      data: (history) => [
        history.column((s) => s.fps_shown),
        history.column((s) => s.bitrate_kbps / 1000),
      ],
    };
  }

  private plot(title: string, series: uPlot.Series[], axes: uPlot.Axis[]): uPlot {
    this.host_.append(make('h2', {}, title));
    const from_zero: uPlot.Scale = { range: (_, _low, high) => [0, Math.max(high * 1.1, 1)] };
    return new uPlot(
      {
        width: this.width(),
        height: height_px,
        series: [{}, ...series],
        axes: [time_axis(this.host_), ...axes],
        scales: { x: { time: false }, y: from_zero, bits: from_zero },
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
