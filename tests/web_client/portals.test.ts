import { describe, expect, it } from 'vitest';
import { rotate, type Vec3 } from '#client/base/vector';
import {
  address_in,
  address_led_to,
  arrival,
  lasting_name,
  target_of,
} from '#client/portals/portals';
import { read_tours, write_tours, type Portal } from '#client/tour/tour';
import { expect_vec } from './cameras';

const up: Vec3 = [0, -1, 0];
const listing = (id: string, title = id) => ({ id, title, credits: '', licence: '' });
const scenes = [
  listing('hall-kdfmqrtv', 'The hall'),
  listing('attic-bcdfghjk'),
  listing('attic-kjhgfdcb'),
  listing('town'),
];

/** The portal of a stop, as a sidecar has it. */
function portal(written: object): Portal {
  const stops = [{ position: [0, 0, 0], look_at: [0, 0, 1], portal: written }];
  return read_tours([{ stops }], up, 1)[0]!.stops[0]!.portal!;
}

describe('a portal', () => {
  it('is read, and written as it was', () => {
    for (const written of [
      { scene: 'hall' },
      { scene: 'hall', tour: 2, stop: 3 },
      { scene: 'hall', position: [1, 2, 3], look_at: [0, 0, 5], fov_deg: 50 },
      { scene: 'hall', position: [1, 2, 3], orientation: [0, 0.6, 0, 0.8] },
    ]) {
      const stops = [{ title: 'Door', position: [0, 0, 0], look_at: [0, 0, 1], portal: written }];
      const [tour] = write_tours(read_tours([{ title: '', stops }], up, 1)) as [
        { stops: [{ portal: object }] },
      ];
      expect(tour.stops[0].portal).toEqual(written);
    }
  });

  it('names the place of a mistake', () => {
    expect(() => portal({ stop: 1 })).toThrow("portal: 'scene' is missing");
    expect(() => portal({ scene: 'hall', stop: 0 })).toThrow('portal.stop');
    expect(() => portal({ scene: 'hall', tour: 1.5 })).toThrow('portal.tour');
    expect(() => portal({ scene: 'hall', position: [0, 0, 0] })).toThrow(
      "portal: 'look_at' or 'orientation' is missing",
    );
  });

  it('leads to the scene of its id, or to the only one of its name', () => {
    expect(target_of(portal({ scene: 'hall' }), scenes)).toEqual({
      scene_id: 'hall-kdfmqrtv',
      title: 'The hall',
    });
    expect(target_of(portal({ scene: 'hall-kdfmqrtv' }), scenes).scene_id).toBe('hall-kdfmqrtv');
    expect(target_of(portal({ scene: 'town' }), scenes).scene_id).toBe('town');
    for (const scene of ['attic', 'castle', 'hall-bcdfghjk']) {
      expect(target_of(portal({ scene }), scenes)).toEqual({ scene_id: undefined, title: scene });
    }
    expect(lasting_name('hall-kdfmqrtv', scenes)).toBe('hall');
    expect(lasting_name('attic-bcdfghjk', scenes)).toBe('attic-bcdfghjk');
  });

  it('arrives upright in the other scene', () => {
    const sideways: Vec3 = [1, 0, 0];
    const { eye } = arrival(
      portal({ scene: 'hall', position: [0, 0, 0], look_at: [0, 0, 4] }),
      sideways,
      0.9,
    );
    expect_vec(rotate(eye!.orientation, [0, 0, 1]), [0, 0, 1]);
    expect_vec(rotate(eye!.orientation, [0, -1, 0]), sideways);
    expect(eye!.fov_y_rad).toBe(0.9);
    expect(arrival(portal({ scene: 'hall', stop: 2 }), up, 1)).toMatchObject({
      eye: undefined,
      stop_index: 1,
    });
  });

  it('keeps what the address says of the page, and neither token nor host', () => {
    const view = { eye: undefined, mode: undefined, tour_index: undefined, stop_index: 1 };
    const address = address_in(
      'https://a.example/x/?scene=town&lang=de&author#watch=w&token=t',
      'hall',
      view,
    );
    expect(address).toBe('https://a.example/x/?scene=hall&lang=de&author=#stop=2');
  });

  it('comes along with a host, and leads to no view of the scene before', () => {
    const led = (hash: string): string =>
      address_led_to(`https://a.example/x/?scene=town&lang=de#${hash}`, 'hall');
    expect(led('watch=w')).toBe('https://a.example/x/?scene=hall&lang=de#watch=w');
    expect(led('at=1,2,3,0,0,0,1,60&stop=2')).toBe('https://a.example/x/?scene=hall&lang=de');
  });
});
