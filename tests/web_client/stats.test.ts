import { create, type MessageInitShape } from '@bufbuild/protobuf';
import { describe, expect, it } from 'vitest';
import { percentile, TimeWindow } from '#client/base/time_window';
import type { Frame } from '#client/decode/picture';
import { StatsHistory } from '#client/stats/history';
import { Metrics } from '#client/stats/metrics';
import { PoseAge } from '#client/stats/pose_age';
import { rest_note, row_texts, slowest_stage, stats_rows } from '#client/ui/stats_rows';
import { FrameHeaderSchema, StatsSchema } from '#client/wire/wire';

const ms = 1000;

describe('TimeWindow', () => {
  it('forgets what is older than its span, and never holds more than its capacity', () => {
    const window = new TimeWindow(100, 3);
    window.push(0, 1);
    window.push(50, 2);
    expect(window.values(100)).toEqual([1, 2]);
    expect(window.values(101)).toEqual([2]);
    for (let i = 0; i < 10; ++i) window.push(110, i);
    expect(window.values(110)).toEqual([7, 8, 9]);
    expect(window.values(1000)).toEqual([]);
    expect(window.newest()).toEqual([7, 8, 9]);
  });
});

describe('percentile', () => {
  it('is the nearest rank', () => {
    const values = [5, 1, 4, 2, 3];
    expect(percentile(values, 0.5)).toBe(3);
    expect(percentile(values, 0.95)).toBe(5);
    expect(percentile(values, 0)).toBe(1);
    expect(percentile([], 0.5)).toBeNaN();
  });
});

describe('pose age', () => {
  const tick = 10 * ms;

  it('is now minus the sample time of the shown pose, at every tick', () => {
    const age = new PoseAge(1e9, tick);
    age.sent(1n, 0);
    age.shown(1n, 0, 5 * ms);
    age.sent(2n, 10 * ms);
    age.sent(3n, 20 * ms);
    age.shown(2n, 10 * ms, 40 * ms);
    // Pose 1 was shown at 10, 20, 30 and 40 ms.
    expect(age.values(40 * ms)).toEqual([10, 20, 30, 40].map((v) => v * ms));
    // From then on pose 2, sampled at 10 ms.
    expect(age.values(60 * ms).slice(4)).toEqual([40, 50].map((v) => v * ms));
  });

  it('grows while the picture is frozen', () => {
    const age = new PoseAge(1e9, tick);
    age.sent(1n, 0);
    age.shown(1n, 0, 0);
    age.sent(2n, 10 * ms);
    const ages = age.values(1010 * ms);
    expect(ages).toHaveLength(101);
    expect(Math.max(...ages)).toBe(1010 * ms);
  });

  it('does not count a rest with the newest pose shown', () => {
    const age = new PoseAge(1e9, tick);
    age.sent(1n, 0);
    age.shown(1n, 0, 20 * ms);
    expect(age.values(5000 * ms)).toEqual([]);
    age.sent(2n, 5000 * ms);
    age.shown(2n, 5000 * ms, 5030 * ms);
    expect(age.values(6000 * ms)).toEqual([10, 20, 30, 40].map((v) => v * ms));
  });
});

describe('the history', () => {
  it('is what plots show and a file keeps, of the last two minutes', () => {
    const history = new StatsHistory();
    const empty = new Metrics().snapshot(0);
    for (let i = 0; i < 600; ++i) history.add({ ...empty, fps_shown: i }, 1000 + 250 * i);
    expect(history.samples).toHaveLength(480);
    expect(history.samples[479]!.time_s).toBeCloseTo(599 * 0.25, 6);
    expect(history.column((s) => s.fps_shown).slice(-2)).toEqual([598, 599]);
    expect(history.column((s) => s.motion_to_photon_ms.p50)[0]).toBeNull();
    const file = JSON.parse(history.to_json({ renderer: 'CPU' }, '2026-01-01')) as object;
    expect(file).toMatchObject({ made: '2026-01-01', renderer: 'CPU' });
  });

  it('forgets what is older, however seldom somebody looks', () => {
    const history = new StatsHistory();
    const empty = new Metrics().snapshot(0);
    for (let s = 0; s <= 600; s += 20) history.add(empty, 1000 * s);
    expect(history.samples.map(({ time_s }) => time_s)).toEqual([500, 520, 540, 560, 580, 600]);
  });
});

describe('metrics', () => {
  const frame = (pose_id: bigint, pose_time_us: number, received_us: number): Frame => ({
    header: create(FrameHeaderSchema, {
      frameId: pose_id,
      poseId: pose_id,
      poseClientTimeUs: BigInt(pose_time_us),
      widthPx: 640,
      heightPx: 360,
      renderUs: 12_000,
    }),
    received_us,
    decoded_us: received_us + 2 * ms,
  });

  it('count frames and bytes per second, and latency on the client clock', () => {
    const metrics = new Metrics();
    for (let i = 1; i <= 40; ++i) {
      const now_us = i * 50 * ms;
      metrics.received(1000, now_us - 10 * ms);
      metrics.presented(frame(BigInt(i), now_us - 45 * ms, now_us - 10 * ms), now_us);
    }
    const stats = metrics.snapshot(2000 * ms);
    expect(stats.fps_shown).toBe(20);
    expect(stats.bitrate_kbps).toBe(160);
    expect(stats.motion_to_photon_ms).toEqual({ p50: 45, p95: 45 });
    // 45 ms pass from pose to picture. In 23 of them neither the server nor this browser has it.
    expect(stats.stages_ms).toMatchObject({ render: 12, network: 23, decode: 2, present: 8 });
    expect([stats.width_px, stats.height_px]).toEqual([640, 360]);
  });

  it('do not take the refinement of a still picture for latency', () => {
    const metrics = new Metrics();
    metrics.presented(frame(1n, 0, 20 * ms), 30 * ms);
    metrics.presented(frame(1n, 0, 500 * ms), 510 * ms);
    expect(metrics.snapshot(600 * ms).motion_to_photon_ms).toEqual({ p50: 30, p95: 30 });
  });

  it('tell stages of a moving camera, whatever pictures at rest take', () => {
    const metrics = new Metrics();
    const moving = frame(1n, 0, 20 * ms);
    metrics.presented(moving, 30 * ms);
    const header = create(FrameHeaderSchema, { ...moving.header, still: true, renderUs: 90_000 });
    metrics.presented({ ...moving, header }, 200 * ms);
    expect(metrics.snapshot(300 * ms).stages_ms.render).toBe(12);
  });

  it('measure no stage by the first picture of a pose that is drawn at rest', () => {
    const metrics = new Metrics();
    const { header, ...rest } = frame(1n, 0, 20 * ms);
    metrics.presented({ ...rest, header: { ...header, still: true } }, 30 * ms);
    expect(new Set(Object.values(metrics.snapshot(40 * ms).stages_ms))).toEqual(new Set([NaN]));
  });

  it('keep what the last motion was like, through a rest of any length', () => {
    const metrics = new Metrics();
    metrics.pose_sent(1n, 0);
    metrics.presented(frame(1n, 0, 20 * ms), 30 * ms);
    const at_rest = metrics.snapshot(3600e6);
    expect(at_rest.stages_ms.network).toBeNaN();
    expect(at_rest.motion_to_photon_ms.p50).toBeNaN();
    expect(at_rest.last_motion).toMatchObject({
      motion_to_photon_ms: { p50: 30, p95: 30 },
      stages_ms: { render: 12, network: 8, decode: 2, present: 8 },
    });
  });

  it('say so when nothing was measured', () => {
    const stats = new Metrics().snapshot(0);
    expect(stats.fps_shown).toBe(0);
    expect(stats.motion_to_photon_ms.p50).toBeNaN();
    expect(stats.stages_ms.render).toBeNaN();
  });
});

describe('statistics panel', () => {
  const frame: Frame = {
    header: create(FrameHeaderSchema, {
      poseId: 1n,
      widthPx: 640,
      heightPx: 360,
      waitUs: 29_000,
      renderUs: 133_000,
      encodeUs: 36_000,
      sendWaitUs: 5000,
    }),
    received_us: 210 * ms,
    decoded_us: 212 * ms,
  };
  const texts = (metrics: Metrics): Record<string, string> => {
    const stats = metrics.snapshot(220 * ms);
    return Object.fromEntries(stats_rows.map((row) => [row.label, row.text(stats)]));
  };

  it('gives each part of a frame a row, and knows the slowest', () => {
    const metrics = new Metrics();
    metrics.presented(frame, 220 * ms);
    expect(texts(metrics)).toMatchObject({
      Wait: '29.0 ms',
      Render: '133.0 ms',
      Encode: '36.0 ms',
      Send: '5.0 ms',
      Decode: '2.0 ms',
      Display: '8.0 ms',
      Picture: '640 × 360',
    });
    expect(slowest_stage(metrics.snapshot(220 * ms).stages_ms)).toBe('render');
  });

  it('tells of the last motion while the camera rests', () => {
    const metrics = new Metrics();
    expect(rest_note(metrics.snapshot(0))).toBe('');
    metrics.presented(frame, 220 * ms);
    const moving = metrics.snapshot(220 * ms);
    expect(rest_note(moving)).toBe('');
    expect(row_texts(moving).some(({ kept }) => kept)).toBe(false);
    const resting = metrics.snapshot(3600e6);
    expect(rest_note(resting)).toMatch(/last motion/);
    const rows = Object.fromEntries(
      row_texts(resting).map((row, i) => [stats_rows[i]!.label, row] as const),
    );
    expect(rows).toMatchObject({
      Shown: { text: '0.0 fps', kept: false },
      Render: { text: '133.0 ms', kept: true },
      Network: { text: '7.0 ms', kept: true },
      Display: { text: '8.0 ms', kept: true },
      'Pose age': { text: '–', kept: false },
    });
  });

  it('says how to measure where the camera has not moved', () => {
    const metrics = new Metrics();
    metrics.presented({ ...frame, header: { ...frame.header, still: true } }, 220 * ms);
    expect(rest_note(metrics.snapshot(230 * ms))).toMatch(/move it/i);
  });

  it('says what the GPU does, and how often it lists the Gaussians in view', () => {
    const metrics = new Metrics();
    const said = (stats: MessageInitShape<typeof StatsSchema>): string => {
      metrics.server_said(create(StatsSchema, stats));
      return texts(metrics)['GPU']!;
    };
    expect(said({ deviceMs: 0.514, framesPerKey: 3.25, windowsCut: 2 })).toBe(
      '0.51 ms · 3.3 frames a list · 2 left early',
    );
    expect(said({ deviceMs: 0.6, framesPerKey: 1 })).toBe('0.60 ms');
    expect(said({ deviceMs: 0 })).toBe('0.60 ms'); // nothing was drawn
  });

  it('shows one dash for what was not measured', () => {
    expect(new Set(Object.values(texts(new Metrics())))).toEqual(new Set(['–']));
    expect(slowest_stage(new Metrics().snapshot(0).stages_ms)).toBeUndefined();
  });
});
