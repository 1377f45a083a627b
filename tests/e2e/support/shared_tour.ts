// One visitor presents to others.
import type { Page } from 'playwright-core';

/** Presents as Ada. Returns the link for participants. */
export async function present(page: Page): Promise<string> {
  await page.getByRole('button', { name: 'Share' }).click();
  await page.getByLabel('Your name, shown to participants').fill('Ada');
  await page.getByRole('button', { name: 'Present', exact: true }).click();
  const link = await page.getByLabel('Link for participants').inputValue();
  await page.getByText('You are presenting. Nobody has joined yet.').waitFor();
  return link;
}
