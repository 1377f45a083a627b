// Texts for those who run a server. They are English in every language of the page.
import { english_operator } from './generated/english';
import { messages } from './messages';
import { locale } from './text';

export const operator = messages(english_operator, 'en', locale);
