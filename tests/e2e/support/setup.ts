// Runs at the start of each file of browser tests, which share a process and with it a browser.
import { afterAll, afterEach, beforeEach, inject } from 'vitest';
import { give_back_pages } from './browser';
import { begin_test, end_file, end_test } from './clean_up';

process.env['TMPDIR'] = inject('scratch');
beforeEach(begin_test);
afterEach(async ({ task }) => {
  try {
    await give_back_pages(task.result?.state !== 'fail');
  } finally {
    await end_test();
  }
});
afterAll(end_file);
