import { Hello_Device } from '../wire/wire';

export interface Surroundings {
  readonly user_agent: string;
  readonly coarse_pointer: boolean;
  /** The shorter side of the screen, CSS px. */
  readonly screen_px: number;
}

const headset = /\b(OculusBrowser|Quest|Pico|VisionOS)\b/i;
const largest_phone_px = 600;

/** What the visitor holds, for the counts of visits. */
export function device_kind({ user_agent, coarse_pointer, screen_px }: Surroundings): Hello_Device {
  if (headset.test(user_agent)) return Hello_Device.HEADSET;
  if (!coarse_pointer) return Hello_Device.DESKTOP;
  return screen_px < largest_phone_px ? Hello_Device.PHONE : Hello_Device.TABLET;
}
