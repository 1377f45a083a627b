// The page's end of the worker.
import { Signal } from '../base/signal';
import type { StatsReport } from '../stats/metrics';
import { text } from '../text/text';
import type { FromWorker, Snapshot, ToWorker } from './messages';

type Answer = StatsReport | Snapshot | undefined;
type Said = Exclude<FromWorker, { kind: 'stats' } | { kind: 'snapshot' }>;
type SaidOf<K extends Said['kind']> = Extract<Said, { kind: K }>;

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
      const message = event.message || text.cards.broken.no_worker;
      this.signals_.get('broken')?.emit({ kind: 'broken', message });
    };
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
      this.waiting_.set(request, resolve);
      this.post({ kind, request });
    });
  }

  private answer(request: number, answer: Answer): void {
    this.waiting_.get(request)?.(answer);
    this.waiting_.delete(request);
  }
}
