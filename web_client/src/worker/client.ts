// The page's end of the worker.
import { browser_timers } from '../base/clock';
import { after_awake } from '../base/patience';
import { Signal } from '../base/signal';
import type { StatsReport } from '../stats/metrics';
import { text } from '../text/text';
import type { FromWorker, Snapshot, ToWorker } from './messages';

type Answer = StatsReport | Snapshot | undefined;
type Said = Exclude<FromWorker, { kind: 'stats' } | { kind: 'snapshot' }>;
type SaidOf<K extends Said['kind']> = Extract<Said, { kind: K }>;

const longest_answer_s = 15;

export class WorkerClient {
  private readonly worker_ = new Worker(new URL('./worker.ts', import.meta.url), {
    type: 'module',
    name: 'catgs',
  });
  private readonly signals_ = new Map<Said['kind'], Signal<Said>>();
  private readonly waiting_ = new Map<number, (answer: Answer) => void>();
  private requests_ = 0;

  constructor() {
    this.worker_.onmessage = ({ data }: MessageEvent<FromWorker>) => {
      if (data.kind === 'stats') this.answer(data.request, data.stats);
      else if (data.kind === 'snapshot') this.answer(data.request, data.snapshot);
      else this.signals_.get(data.kind)?.emit(data);
    };
    this.worker_.onerror = (event) => {
      // The event has no message when the worker could not be loaded at all.
      if (!event.message) this.break_off(text.cards.broken.no_worker);
      else this.signals_.get('error')?.emit({ kind: 'error', message: event.message });
    };
  }

  private break_off(message: string): void {
    this.signals_.get('broken')?.emit({ kind: 'broken', message });
  }

  on<K extends Said['kind']>(kind: K, listener: (message: SaidOf<K>) => void): void {
    const signal = this.signals_.get(kind) ?? new Signal<Said>();
    this.signals_.set(kind, signal);
    signal.listen((message) => listener(message as SaidOf<K>));
  }

  post(message: ToWorker, transfer: Transferable[] = []): void {
    this.worker_.postMessage(message, transfer);
  }

  stats(): Promise<StatsReport> {
    return this.ask('get_stats') as Promise<StatsReport>;
  }

  /** Undefined before the first picture. */
  snapshot(): Promise<Snapshot | undefined> {
    return this.ask('get_snapshot') as Promise<Snapshot | undefined>;
  }

  private ask(kind: 'get_stats' | 'get_snapshot'): Promise<Answer> {
    const request = ++this.requests_;
    return new Promise((resolve) => {
      // A worker that the browser has ended says nothing.
      const cancel = after_awake(browser_timers, longest_answer_s, () => {
        this.waiting_.delete(request);
        this.break_off(text.cards.broken.no_worker);
      });
      this.waiting_.set(request, (answer) => {
        cancel();
        resolve(answer);
      });
      this.post({ kind, request });
    });
  }

  private answer(request: number, answer: Answer): void {
    this.waiting_.get(request)?.(answer);
    this.waiting_.delete(request);
  }
}
