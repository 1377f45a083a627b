#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace catgs {

/// Makes a token `payload.mac`, both base64url: the payload in clear and its HMAC-SHA256 under
/// `key`. `purpose` is part of the signed text, so a token is only valid for its own purpose.
std::string sign_token(std::string_view purpose, std::string_view payload, std::string_view key);
/// Returns the payload if the token was signed for this purpose with this key. The comparison takes
/// constant time.
std::optional<std::string> read_signed_token(std::string_view purpose, std::string_view token,
                                             std::string_view key);

/// A name for a secret text, 128 bits in hexadecimal, that tells nothing of it to those without
/// `key`. Servers with the key give it the same name.
std::string keyed_name(std::string_view purpose, std::string_view text, std::string_view key);

/// SHA-256. Texts are compared by digest, so that the time taken does not tell where they differ.
using TokenDigest = std::array<unsigned char, 32>;
TokenDigest digest_of(std::string_view text);
bool equal_in_constant_time(const TokenDigest& a, const TokenDigest& b);

/// Returns 32 bytes from the system's random source. Throws std::runtime_error if there is none.
std::string random_key();
/// Returns 128 random bits in hexadecimal, unique across servers.
std::string random_id();

}  // namespace catgs
