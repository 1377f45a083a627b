// Runs at the start of each file of browser tests, which share a process and with it a browser.
import { afterAll, afterEach, inject } from 'vitest';
import { give_back_pages } from './browser';
import { end_all } from './clean_up';

process.env['TMPDIR'] = inject('scratch');
afterEach(({ task }) => give_back_pages(task.result?.state !== 'fail'));
afterAll(end_all);
