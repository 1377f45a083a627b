// Lengths and areas as visitors write them.
import { clamp } from '../base/vector';
import type { KeptTexts } from '../base/browser_storage';
import { number } from '../text/number';
import { locale } from '../text/text';
import type { Measured } from './measurement';

export const systems = ['metric', 'imperial'] as const;
export type System = (typeof systems)[number];

/** The system of a locale where the visitor has chosen none. */
export const usual_system = (of_locale: string): System =>
  /-(US|LR|MM)\b/.test(of_locale) ? 'imperial' : 'metric';

/** Units of a system, the smallest first, and how long they are in metres. */
const units: Readonly<
  Record<System, readonly { readonly sign: string; readonly metres: number }[]>
> = {
  metric: [
    { sign: 'cm', metres: 0.01 },
    { sign: 'm', metres: 1 },
    { sign: 'km', metres: 1000 },
  ],
  imperial: [
    { sign: 'in', metres: 0.0254 },
    { sign: 'ft', metres: 0.3048 },
    { sign: 'mi', metres: 1609.344 },
  ],
};

/** How a value is written: in `sign`, and as `power` of lengths (1 or 2). */
export interface Scale {
  /** Undefined: lengths are in world units. */
  readonly metres_per_unit: number | undefined;
  readonly system: System;
}

/** "3.421 m ± 0.050 m". Decimals follow the error, because further ones would mean nothing. */
export function written({ value, error }: Measured, scale: Scale, power: 1 | 2 = 1): string {
  const write = writer({ value, error }, scale, power, 2);
  return error > 0 ? `${write(value)} ± ${write(error)}` : write(value);
}

/** "3.42 m": the value alone, with the digits that its error leaves sure. */
export const written_on_line = (measured: Measured, scale: Scale, power: 1 | 2 = 1): string =>
  writer(measured, scale, power, 1)(measured.value);

/** "12 m²": of a sketch, whose error nobody knows. */
export function rough(value: number, scale: Scale, power: 1 | 2): string {
  const [factor, sign] = unit_for(value, scale, power);
  return `${number(value * factor, { maximumSignificantDigits: 2 })}${sign}`;
}

/** A round length for a scale bar, at most this long, in world units. */
export function bar_within(most: number, scale: Scale): { length: number; text: string } {
  const [factor] = unit_for(most, scale, 1);
  const decade = 10 ** Math.floor(Math.log10(most * factor));
  const steps = [5, 2, 1].map((step) => step * decade);
  const round = steps.find((step) => step <= most * factor * (1 + 1e-9)) ?? decade;
  return { length: round / factor, text: rough(round / factor, scale, 1) };
}

/** By what a value is multiplied, and the sign behind it. */
function unit_for(
  value: number,
  scale: Scale,
  power: 1 | 2,
): readonly [factor: number, sign: string] {
  const metres = (scale.metres_per_unit ?? 1) ** power;
  if (!scale.metres_per_unit) return [1, ''];
  const list = units[scale.system];
  const size = Math.abs(value) * metres * (1 + 1e-9);
  const unit = list.filter((of) => size >= of.metres ** power).pop() ?? list[0]!;
  return [metres / unit.metres ** power, `\u00a0${unit.sign}${power === 2 ? '²' : ''}`];
}

/** `digits`: of the error. Where there is none, the value has three. */
function writer(
  { value, error }: Measured,
  scale: Scale,
  power: 1 | 2,
  digits: number,
): (amount: number) => string {
  const [factor, sign] = unit_for(value, scale, power);
  const [of, count] = error > 0 ? [error, digits] : [Math.abs(value), 3];
  const first = Math.floor(Math.log10(Math.max(of * factor, 1e-6)));
  const decimals = clamp(count - 1 - first, 0, 6);
  const options = { minimumFractionDigits: decimals, maximumFractionDigits: decimals };
  return (amount) => `${number(amount * factor, options).replace('-', '−')}${sign}`;
}

const system_key = 'catgs.units';

/** What the visitor has chosen in this browser, or what is usual where they live. */
export const kept_system = (storage: KeptTexts): System =>
  systems.find((system) => system === storage.getItem(system_key)) ?? usual_system(locale);

export const keep_system = (storage: KeptTexts, system: System): void =>
  storage.setItem(system_key, system);
