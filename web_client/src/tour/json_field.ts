import { section_of, type Section } from '../camera/section';
import { unit, type Quat, type Vec3 } from '../base/vector';
import { text } from '../text/text';
import { max_text_characters } from './limits';

const { mistakes } = text;

/** A value of a document that people wrote. Its errors name its path: "tours[0].title: …". */
export class JsonField {
  constructor(
    private readonly path_: string,
    private readonly value_: unknown,
  ) {}

  fail(what: string): never {
    throw new Error(`${this.path_}: ${what}`);
  }

  /** The member; undefined where it is missing or null. */
  find(key: string): JsonField | undefined {
    if (typeof this.value_ !== 'object' || this.value_ === null) this.fail(mistakes.not_an_object);
    const value = (this.value_ as Record<string, unknown>)[key];
    if (value === undefined || value === null) return undefined;
    return new JsonField(`${this.path_}.${key}`, value);
  }

  at(key: string): JsonField {
    return this.find(key) ?? this.fail(mistakes.missing({ member: key }));
  }

  elements(most: number): JsonField[] {
    if (!Array.isArray(this.value_)) this.fail(mistakes.not_a_list);
    if (this.value_.length > most)
      this.fail(mistakes.too_many({ count: this.value_.length, most }));
    return this.value_.map((value, i) => new JsonField(`${this.path_}[${i}]`, value));
  }

  members(most: number): [name: string, value: JsonField][] {
    if (typeof this.value_ !== 'object' || this.value_ === null) this.fail(mistakes.not_an_object);
    const members = Object.entries(this.value_);
    if (members.length > most) this.fail(mistakes.too_many({ count: members.length, most }));
    return members.map(([name, value]) => [name, new JsonField(`${this.path_}.${name}`, value)]);
  }

  /** Fails where a list has fewer elements. */
  at_least(least: number): this {
    const count = Array.isArray(this.value_) ? this.value_.length : 0;
    if (count < least) this.fail(mistakes.too_few({ count, least }));
    return this;
  }

  /** The text, cut off at the limit. */
  text(): string {
    if (typeof this.value_ !== 'string') this.fail(mistakes.not_a_text);
    return this.value_.slice(0, max_text_characters);
  }

  truth(): boolean {
    if (typeof this.value_ !== 'boolean') this.fail(mistakes.not_a_truth);
    return this.value_;
  }

  number(low = -1e9, high = 1e9): number {
    const value = this.value_;
    if (typeof value !== 'number' || !(value >= low && value <= high)) {
      this.fail(mistakes.not_in({ low, high }));
    }
    return value;
  }

  /** A whole number that counts from 1, as an index. */
  ordinal(most: number): number {
    const value = this.number(1, most);
    if (!Number.isInteger(value)) this.fail(mistakes.not_in({ low: 1, high: most }));
    return value - 1;
  }

  numbers(count: number): number[] {
    const values = this.elements(count).map((value) => value.number());
    if (values.length !== count) this.fail(mistakes.not_numbers({ count }));
    return values;
  }

  vec3(): Vec3 {
    return this.numbers(3) as unknown as Vec3;
  }

  orientation(): Quat {
    return unit(this.numbers(4) as unknown as Quat);
  }

  section(): Section {
    const numbers = this.numbers(7);
    return section_of(numbers) ?? this.fail(mistakes.not_in({ low: 1e-5, high: 1e9 }));
  }

  /** A vertical field of view, written in degrees. */
  fov_rad(): number {
    return (this.number(5, 160) * Math.PI) / 180;
  }
}
