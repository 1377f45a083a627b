// A game controller that the test plays.
import type { Page } from 'playwright-core';

type Pad = { axes: number[]; buttons: { value: number; pressed: boolean }[] };

/** Plugs it in. Returns what holds its sticks, and one of its buttons, from now on. */
export async function plug_in_gamepad(
  page: Page,
): Promise<(axes: number[], button?: number) => Promise<void>> {
  const pad = await page.evaluateHandle(() => {
    const buttons = Array.from({ length: 17 }, () => ({ value: 0, pressed: false }));
    const made = { connected: true, mapping: 'standard', axes: [0, 0, 0, 0], buttons };
    navigator.getGamepads = () => [made as unknown as Gamepad];
    window.dispatchEvent(new Event('gamepadconnected'));
    return made as Pad;
  });
  return (axes, button = -1) =>
    pad.evaluate(
      (held, [values, index]) => {
        held.axes = values;
        held.buttons.forEach((one, i) =>
          Object.assign(one, { pressed: i === index, value: Number(i === index) }),
        );
      },
      [axes, button] as const,
    );
}
