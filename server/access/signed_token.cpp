#include "server/access/signed_token.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>
#include <openssl/sha.h>

namespace catgs {
namespace {

const unsigned char* bytes_of(std::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

std::string hmac(std::string_view purpose, std::string_view payload, std::string_view key) {
  const std::string message = std::string(purpose).append("\n").append(payload);
  TokenDigest digest{};
  unsigned int size = 0;
  HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), bytes_of(message), message.size(),
       digest.data(), &size);
  return {reinterpret_cast<const char*>(digest.data()), size};
}

std::string base64url(std::string_view bytes) {
  std::string out((bytes.size() + 2) / 3 * 4 + 1, '\0');
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(out.data()), bytes_of(bytes),
                                   static_cast<int>(bytes.size()));
  out.resize(static_cast<std::size_t>(size));
  while (out.ends_with('=')) out.pop_back();
  std::ranges::replace(out, '+', '-');
  std::ranges::replace(out, '/', '_');
  return out;
}

std::optional<std::string> from_base64url(std::string_view text) {
  std::string in(text);
  if (in.find_first_of("+/=") != std::string::npos) return std::nullopt;
  std::ranges::replace(in, '-', '+');
  std::ranges::replace(in, '_', '/');
  const std::size_t padding = (4 - in.size() % 4) % 4;
  in.append(padding, '=');
  std::string out(in.size() / 4 * 3, '\0');
  const int size = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(out.data()), bytes_of(in),
                                   static_cast<int>(in.size()));
  if (size < 0 || padding == 3) return std::nullopt;
  out.resize(static_cast<std::size_t>(size) - padding);
  // Unused bits and spaces would give one token several forms.
  if (base64url(out) != text) return std::nullopt;
  return out;
}

template <std::size_t count>
std::array<unsigned char, count> random_bytes() {
  std::array<unsigned char, count> bytes{};
  if (RAND_bytes(bytes.data(), count) != 1)
    throw std::runtime_error("the system has no random numbers");
  return bytes;
}

}  // namespace

TokenDigest digest_of(std::string_view text) {
  TokenDigest digest{};
  static_assert(sizeof digest == SHA256_DIGEST_LENGTH);
  SHA256(bytes_of(text), text.size(), digest.data());
  return digest;
}

bool equal_in_constant_time(const TokenDigest& a, const TokenDigest& b) {
  return CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

std::string sign_token(std::string_view purpose, std::string_view payload, std::string_view key) {
  return base64url(payload) + "." + base64url(hmac(purpose, payload, key));
}

std::optional<std::string> read_signed_token(std::string_view purpose, std::string_view token,
                                             std::string_view key) {
  const auto dot = token.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  auto payload = from_base64url(token.substr(0, dot));
  const auto mac = from_base64url(token.substr(dot + 1));
  if (!payload || !mac ||
      !equal_in_constant_time(digest_of(*mac), digest_of(hmac(purpose, *payload, key))))
    return std::nullopt;
  return payload;
}

std::string keyed_name(std::string_view purpose, std::string_view text, std::string_view key) {
  constexpr std::size_t name_bytes = 16;
  std::string name;
  for (const char byte : hmac(purpose, text, key).substr(0, name_bytes))
    name += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return name;
}

std::string random_key() {
  const auto bytes = random_bytes<32>();
  return {bytes.begin(), bytes.end()};
}

std::string random_id() { return fmt::format("{:02x}", fmt::join(random_bytes<16>(), "")); }

}  // namespace catgs
