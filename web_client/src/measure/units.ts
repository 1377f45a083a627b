// Lengths and areas as visitors write them.
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
  const metres = (scale.metres_per_unit ?? 1) ** power;
  const list = units[scale.system];
  const size = Math.abs(value) * metres;
  const unit = scale.metres_per_unit
    ? (list.filter((of) => size >= of.metres ** power).pop() ?? list[0]!)
    : { sign: '', metres: 1 };
  const factor = metres / unit.metres ** power;
  const sign = unit.sign && `\u00a0${unit.sign}${power === 2 ? '²' : ''}`;
  const digits = Math.min(
    6,
    Math.max(0, 1 - Math.floor(Math.log10(Math.max(error * factor, 1e-6)))),
  );
  const text = (amount: number): string =>
    `${number(amount * factor, { minimumFractionDigits: digits, maximumFractionDigits: digits }).replace('-', '−')}${sign}`;
  return `${text(value)} ± ${text(error)}`;
}

export const system_here = (): System => usual_system(locale);
