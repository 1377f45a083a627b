import { unit, type Quat, type Vec3 } from '../base/vector';
import { max_text_characters } from './limits';

/** A value of a document that people wrote. Its errors name its place: "tours[0].title: …". */
export class JsonPlace {
  constructor(
    private readonly place_: string,
    private readonly value_: unknown,
  ) {}

  fail(what: string): never {
    throw new Error(`${this.place_}: ${what}`);
  }

  /** The member; undefined where it is missing or null. */
  find(key: string): JsonPlace | undefined {
    if (typeof this.value_ !== 'object' || this.value_ === null) this.fail('is not an object');
    const value = (this.value_ as Record<string, unknown>)[key];
    if (value === undefined || value === null) return undefined;
    return new JsonPlace(`${this.place_}.${key}`, value);
  }

  at(key: string): JsonPlace {
    return this.find(key) ?? this.fail(`'${key}' is missing`);
  }

  elements(most: number): JsonPlace[] {
    if (!Array.isArray(this.value_)) this.fail('is not a list');
    if (this.value_.length > most) this.fail(`has ${this.value_.length} entries, at most ${most}`);
    return this.value_.map((value, i) => new JsonPlace(`${this.place_}[${i}]`, value));
  }

  /** The text, cut off at the limit. */
  text(): string {
    if (typeof this.value_ !== 'string') this.fail('is not a text');
    return this.value_.slice(0, max_text_characters);
  }

  truth(): boolean {
    if (typeof this.value_ !== 'boolean') this.fail('is not true or false');
    return this.value_;
  }

  number(low = -1e9, high = 1e9): number {
    const value = this.value_;
    if (typeof value !== 'number' || !(value >= low && value <= high)) {
      this.fail(`is not a number in ${low}…${high}`);
    }
    return value;
  }

  numbers(count: number): number[] {
    const values = this.elements(count).map((value) => value.number());
    if (values.length !== count) this.fail(`is not ${count} numbers`);
    return values;
  }

  vec3(): Vec3 {
    return this.numbers(3) as unknown as Vec3;
  }

  orientation(): Quat {
    return unit(this.numbers(4) as unknown as Quat);
  }

  /** A vertical field of view, written in degrees. */
  fov_rad(): number {
    return (this.number(5, 160) * Math.PI) / 180;
  }
}
