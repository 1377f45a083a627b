// Remembers decoders that failed in this browser, so that the next visit does not try them again.
import type { KeptTexts } from '../base/browser_storage';
import { decoder_ladder, type DecoderRung } from './ladder';

const storage_key = 'catgs.decoder';
const keep_ms = 7 * 24 * 3600 * 1000; // drivers get better

interface Remembered {
  readonly rung: DecoderRung;
  readonly agent: string;
  readonly until_ms: number;
}

/** The rung to begin with: the top one, unless decoders of this browser failed recently. */
export function remembered_rung(storage: KeptTexts, agent: string, now_ms: number): DecoderRung {
  try {
    const text = storage.getItem(storage_key);
    const memory = text ? (JSON.parse(text) as Partial<Remembered>) : {};
    const known = decoder_ladder.find((rung) => rung === memory.rung);
    if (known && memory.agent === agent && (memory.until_ms ?? 0) > now_ms) return known;
  } catch (error) {
    console.warn('what was remembered of decoders cannot be read', error);
  }
  return decoder_ladder[0];
}

export function remember_rung(
  rung: DecoderRung,
  storage: KeptTexts,
  agent: string,
  now_ms: number,
): void {
  const memory: Remembered = { rung, agent, until_ms: now_ms + keep_ms };
  storage.setItem(storage_key, JSON.stringify(memory));
}
