// The samples that leave the page.
import { beforeEach, describe, expect, it, vi } from 'vitest';
import type { CameraController } from '#client/camera/camera_controller';
import { CameraLoop } from '#client/camera/camera_loop';
import type { CameraSample } from '#client/camera/eye';
import { Inertia } from '#client/camera/inertia';
import { no_axes, type Axes } from '#client/camera/movement';
import { camera as make_camera } from './cameras';

describe('the camera loop', () => {
  let refreshes: (() => void)[] = [];
  let now_us = 0;
  let axes: Axes = no_axes;
  let touched = false;
  let sent: CameraSample[] = [];
  let camera: CameraController;
  let loop: CameraLoop;

  const refresh = (count = 1): void => {
    for (let i = 0; i < count; ++i) {
      now_us += 16_667;
      for (const draw of refreshes.splice(0)) draw();
    }
  };
  const said = (): string[] =>
    sent.map(({ pose_id, at_rest }) => `${pose_id}${at_rest ? ' at rest' : ''}`);

  beforeEach(() => {
    refreshes = [];
    sent = [];
    axes = no_axes;
    touched = false;
    vi.stubGlobal('requestAnimationFrame', (draw: () => void) => refreshes.push(draw));
    camera = make_camera();
    const clock = { now_us: () => now_us };
    loop = new CameraLoop(
      camera,
      () => axes,
      () => touched,
      new Inertia(),
      clock,
      (sample) => sent.push(sample),
    );
    loop.enable();
  });

  it('says that nothing moves a refresh after the last sample, once, and then stops', () => {
    refresh();
    expect(said()).toEqual(['1']);
    expect(loop.pending).toBe(true);
    refresh(5);
    expect(said()).toEqual(['1', '1 at rest']);
    expect(sent[1]!.eye).toEqual(sent[0]!.eye);
    expect(loop.pending).toBe(false);
    expect(refreshes).toEqual([]);
  });

  it('says nothing of the kind while a key is held, nor while a finger is down', () => {
    refresh(3);
    sent = [];
    axes = { ...no_axes, forward: 1 };
    loop.wake();
    refresh(3);
    expect(said()).toEqual(['2', '3', '4']);
    axes = no_axes;
    touched = true;
    refresh(3);
    expect(said()).toEqual(['2', '3', '4']);
    touched = false;
    loop.wake(); // it was let go
    refresh(3);
    expect(said()).toEqual(['2', '3', '4', '4 at rest']);
  });

  it('has a new sample for a gesture after a rest', () => {
    refresh(3);
    sent = [];
    camera.gesture({ kind: 'look', dx: 0.1, dy: 0 });
    loop.wake();
    refresh(4);
    expect(said()).toEqual(['2', '2 at rest']);
  });
});
