/** Ways to decode, best first. The last one needs no video decoder. */
export const decoder_ladder = [
  'prefer-hardware',
  'no-preference',
  'prefer-software',
  'jpeg',
] as const;

export type DecoderRung = (typeof decoder_ladder)[number];

export const failures_per_rung = 2; // one may be a broken frame; two are a broken decoder

/** The rungs from `first` down. */
export function rungs_from(first: DecoderRung): readonly DecoderRung[] {
  return decoder_ladder.slice(decoder_ladder.indexOf(first));
}
