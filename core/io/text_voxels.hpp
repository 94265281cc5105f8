#pragma once
// Voxels written as text, hexadecimal digits or numbers, as the bytes that they stand for (little
// endian numbers).

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/byte_source.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core {

/// The characters of a file from byte `offset` on, one by one.
class CharacterSource {
 public:
  CharacterSource(const std::shared_ptr<const InputFile> &file, std::uint64_t offset)
      : source_(file, offset) {}
  /// Empty at the end.
  std::optional<char> next();
  const std::string &what() const { return source_.file().what(); }

 private:
  FileSource source_;
  std::vector<std::byte> buffer_;
  std::size_t position_ = 0;
};

/// Two hexadecimal digits for each byte, the higher first; white space anywhere.
class HexSource : public ByteSource {
 public:
  HexSource(const std::shared_ptr<const InputFile> &file, std::uint64_t offset)
      : characters_(file, offset) {}
  std::size_t read(std::span<std::byte> bytes) override;

 private:
  std::optional<unsigned> next_digit();

  CharacterSource characters_;
};

/// Decimal numbers between white space or commas. One that is no number of `type` is an Error;
/// integers may be written like 1e3 or 7.0.
class NumberSource : public ByteSource {
 public:
  NumberSource(const std::shared_ptr<const InputFile> &file, std::uint64_t offset, VoxelType type)
      : characters_(file, offset), type_(type) {}
  /// bytes.size() must be a multiple of the type's size.
  std::size_t read(std::span<std::byte> bytes) override;

 private:
  /// Empty at the end.
  std::string_view next_word();

  CharacterSource characters_;
  VoxelType type_;
  std::string word_;
};

}  // namespace isowave::core
