import { create } from '@bufbuild/protobuf';
import { describe, expect, it } from 'vitest';
import { scene_setup } from '#client/session/camera_messages';
import { SceneFactsSchema } from '#client/wire/wire';

describe('a scene of the wire', () => {
  const facts = {
    startPose: { position: { x: 0.5, y: 1, z: -5 }, orientation: { w: 1 } },
    focus: { x: 0, y: 0.25, z: 0 },
    limitsMin: { x: -20, y: -20, z: -20 },
    limitsMax: { x: 20, y: 20, z: 20 },
  };

  it.each([
    [undefined, [0, 0, 0]],
    [{ x: 500123, y: 5412345, z: 431 }, [500123, 5412345, 431]],
  ])('has the coordinates of its file, whatever it is about', (origin, [x, y, z]) => {
    const setup = scene_setup(create(SceneFactsSchema, origin ? { ...facts, origin } : facts));
    expect(setup.start_pose.position).toEqual([x! + 0.5, y! + 1, z! - 5]);
    expect(setup.focus).toEqual([x, y! + 0.25, z]);
    expect(setup.limits_min).toEqual([x! - 20, y! - 20, z! - 20]);
    expect(setup.limits_max).toEqual([x! + 20, y! + 20, z! + 20]);
  });
});
