#include "loaders/formats/pickled_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>

namespace q3d::loaders::formats {
namespace {

// The names are in a tuple in a list in a tuple in a list. Limits bound what a few bytes can claim, because a
// memo repeats a value for three bytes and each level of lists costs two.
constexpr int kDeepest = 4;
constexpr std::size_t kMaxNames = 8;  // names of one column
constexpr std::size_t kMaxNameBytes = 1000;
constexpr std::size_t kMaxColumns = 100'000;

struct List;
using Items = std::shared_ptr<List>;  // shared pointer, because a pickle's memo shares lists
struct Mark {};
struct Value {
  std::variant<Mark, std::string, std::int64_t, Items> content;
};
struct List {
  std::vector<Value> items;
  int depth = 1;           // depth of nested lists
  bool is_within = false;  // it is inside another list, and so complete: it cannot contain itself
};

void append_utf8(std::string& text, std::uint32_t code) {
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xC0U | code >> 6U);
    text += static_cast<char>(0x80U | (code & 0x3FU));
  } else if (code < 0x10000) {
    text += static_cast<char>(0xE0U | code >> 12U);
    text += static_cast<char>(0x80U | (code >> 6U & 0x3FU));
    text += static_cast<char>(0x80U | (code & 0x3FU));
  } else {
    text += static_cast<char>(0xF0U | code >> 18U);
    text += static_cast<char>(0x80U | (code >> 12U & 0x3FU));
    text += static_cast<char>(0x80U | (code >> 6U & 0x3FU));
    text += static_cast<char>(0x80U | (code & 0x3FU));
  }
}

class Unpickler {
 public:
  Unpickler(std::string_view pickle, const std::string& where) : pickle_(pickle), where_(where) {}

  Value read() {
    while (true) {
      switch (const char opcode = next()) {
        case '(':
          push({Mark{}});
          break;
        case 'l':
        case 't':
          push(list_of(pop_to_mark()));
          break;
        case ']':
        case ')':
          push({std::make_shared<List>()});
          break;
        case 'a':
          append();
          break;
        case 'V':
          push({unescaped(line())});
          break;
        case 'I':
        case 'L':
          push({integer(line())});
          break;
        case 'p':
          memo_[integer(line())] = top();
          break;
        case 'g':
          push(recall(integer(line())));
          break;
        case '.':
          return pop();
        default:
          fail(fmt::format("the opcode 0x{:02x}", static_cast<unsigned char>(opcode)),
               "lists, tuples, texts and whole numbers of protocol 0; save the table as CSV instead");
      }
    }
  }

 private:
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const {
    throw std::runtime_error(
        fmt::format("{}: byte {} of its pickle: got {}, expected {}", where_, at_, got, expected));
  }

  char next() {
    if (at_ >= pickle_.size()) fail("its end", "more bytes");
    return pickle_[at_++];
  }

  std::string_view line() {
    const std::size_t end = pickle_.find('\n', at_);
    if (end == std::string_view::npos) fail("its end", "the end of a line");
    const std::size_t start = std::exchange(at_, end + 1);
    return pickle_.substr(start, end - start);
  }

  // The stack is bounded, because each push takes a byte of the pickle, and values are shared, not copied.
  void push(Value value) { stack_.push_back(std::move(value)); }

  const Value& top() const {
    if (stack_.empty()) fail("nothing on the stack", "a value");
    return stack_.back();
  }

  Value pop() {
    Value value = top();
    stack_.pop_back();
    return value;
  }

  std::vector<Value> pop_to_mark() {
    std::size_t first = stack_.size();
    while (first > 0 && !std::holds_alternative<Mark>(stack_[first - 1].content)) --first;
    if (first == 0) fail("no mark on the stack", "a mark");
    std::vector<Value> items(stack_.begin() + static_cast<std::ptrdiff_t>(first), stack_.end());
    stack_.resize(first - 1);
    return items;
  }

  void append() {
    const Value item = pop();
    const auto* list = std::get_if<Items>(&top().content);
    if (list == nullptr) fail("no list", "a list to append to");
    put_into(**list, item);
  }

  Value list_of(const std::vector<Value>& items) const {
    auto list = std::make_shared<List>();
    for (const Value& item : items) put_into(*list, item);
    return {std::move(list)};
  }

  void put_into(List& list, const Value& item) const {
    if (const auto* inner = std::get_if<Items>(&item.content)) {
      (*inner)->is_within = true;
      list.depth = std::max(list.depth, (*inner)->depth + 1);
    }
    if (list.is_within)
      fail("an item for a list that is already part of another",
           "lists that are complete before they are nested");
    if (list.depth > kDeepest)
      fail("lists that are nested too deeply", fmt::format("at most {} levels", kDeepest));
    list.items.push_back(item);
  }

  std::int64_t integer(std::string_view text) const {
    if (text.ends_with('L')) text.remove_suffix(1);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) fail("another text", "a whole number");
    return value;
  }

  const Value& recall(std::int64_t key) const {
    const auto found = memo_.find(key);
    if (found == memo_.end()) fail(fmt::format("the memo {}", key), "one that was stored before");
    return found->second;
  }

  // Protocol 0 writes texts as Python's raw-unicode-escape: Latin-1, and \uXXXX or \UXXXXXXXX beyond it.
  std::string unescaped(std::string_view line) const {
    std::string text;
    for (std::size_t i = 0; i < line.size(); ++i) {
      std::uint32_t code = static_cast<unsigned char>(line[i]);
      const char kind = i + 1 < line.size() ? line[i + 1] : '\0';
      if (code == '\\' && (kind == 'u' || kind == 'U')) {
        const std::size_t digits = kind == 'u' ? 4 : 8;
        if (line.size() - i - 2 < digits) fail("an incomplete escape sequence", "all of its digits");
        const char* start = line.data() + i + 2;
        const auto [end, error] = std::from_chars(start, start + digits, code, 16);
        if (error != std::errc() || end != start + digits || code > 0x10FFFF)
          fail("a wrong escape sequence", "hex digits of a character");
        i += 1 + digits;
      }
      append_utf8(text, code);
    }
    return text;
  }

  std::string_view pickle_;
  const std::string& where_;
  std::size_t at_ = 0;
  std::vector<Value> stack_;
  std::map<std::int64_t, Value> memo_;
};

}  // namespace

std::vector<std::vector<std::string>> read_pickled_columns(std::string_view pickle,
                                                           const std::string& where) {
  const auto refuse = [&]() -> std::runtime_error {
    return std::runtime_error(
        fmt::format("{}: got a pickle of another form, expected a list of tuples of column names, "
                    "at most {} names in a tuple and {} bytes in a name",
                    where, kMaxNames, kMaxNameBytes));
  };
  const auto items_of = [&](const Value& value) -> const std::vector<Value>& {
    const auto* items = std::get_if<Items>(&value.content);
    if (items == nullptr) throw refuse();
    return (*items)->items;
  };
  const Value read = Unpickler(pickle, where).read();
  const std::vector<Value>& axes = items_of(read);
  if (axes.size() != 1 || items_of(axes[0]).size() != 2) throw refuse();
  std::vector<std::vector<std::string>> columns;
  for (const Value& tuple : items_of(items_of(axes[0])[1])) {
    std::vector<std::string>& names = columns.emplace_back();
    if (columns.size() > kMaxColumns || items_of(tuple).size() > kMaxNames) throw refuse();
    for (const Value& name : items_of(tuple)) {
      const auto* text = std::get_if<std::string>(&name.content);
      if (text == nullptr || text->size() > kMaxNameBytes) throw refuse();
      names.push_back(*text);
    }
  }
  return columns;
}

}  // namespace q3d::loaders::formats
